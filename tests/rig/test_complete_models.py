"""A shell completes every option and argument that takes a model."""

from __future__ import annotations

import click
import pytest

from rig.cli import Commands
from rig.cli import rig as group


def parameters() -> dict[str, tuple[click.Command, click.Parameter]]:
    """Those that take a model, by command and name; also of the commands below `fleet`."""
    context, found = click.Context(group), {}
    for name in Commands().list_commands(context):
        command = Commands().get_command(context, name)
        assert command is not None
        below = command.commands.values() if isinstance(command, click.Group) else [command]
        for each in below:
            for parameter in each.params:
                if parameter.name in ("model", "models"):
                    found[f"{name} {each.name} {parameter.name}"] = (each, parameter)
    return found


@pytest.mark.parametrize("name", parameters())
def test_models_and_files_are_offered(name: str) -> None:
    command, parameter = parameters()[name]
    offered = parameter.shell_complete(click.Context(command), "lin")
    assert "file" in {item.type for item in offered}
    assert "linear" in {item.value for item in offered}
