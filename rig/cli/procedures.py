"""procedures: list the procedures and what each is for."""

import click


@click.command("procedures")
def command() -> None:
    """List the procedures and what each is for."""
