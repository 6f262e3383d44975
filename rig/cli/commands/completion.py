"""completion: print the script that completes commands, runs and files in bash, zsh or fish."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from rig.cli import COMPLETE, rig

SHELLS = ("bash", "zsh", "fish")


@click.command("completion")
@click.argument("shell", type=click.Choice(SHELLS))
def command(shell: str) -> None:
    """Print the completion script for SHELL.

    \b
    bash   in ~/.bashrc:                   eval "$(rig completion bash)"
    zsh    in ~/.zshrc, after compinit:    eval "$(rig completion zsh)"
    fish   in ~/.config/fish/config.fish:  rig completion fish | source

    The Tab key then completes commands, options, procedures, effects, runs, sensors and files.
    """
    made = get_completion_class(shell)
    if made is None:
        raise click.UsageError(f"click has no completion for {shell}")
    click.echo(made(rig, {}, "rig", COMPLETE).source())
