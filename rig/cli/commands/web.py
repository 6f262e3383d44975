"""web: the workbench in a browser: see where the model fails, click the missing effect, run and watch the rig."""

from __future__ import annotations

import json
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.terminal.output import bench_option, json_option, note

if TYPE_CHECKING:
    from rig.web.server import Place

HERE = ("127.0.0.1", "localhost", "::1")


@click.command("web")
@click.option("--port", type=click.IntRange(1, 65535), help="Port to listen at; without it 8473, or any that is free.")
@click.option("--host", default=HERE[0], show_default=True, help="Another address lets other machines in: see --help.")
@click.option("--no-open", is_flag=True, help="Print the address and open no browser.")
@bench_option
@json_option
def command(port: int | None, host: str, no_open: bool, bench_file: Path | None, as_json: bool) -> None:
    """Serve the workbench until Ctrl-C; print its address, and open it in the browser.

    The address holds a token, without which nothing is answered. Only this machine can reach it, unless --host names
    another address: then whoever reads the network can read the token. A run that was started goes on when the server
    ends.
    """
    from rig.bench import read_bench
    from rig.web.desk import Desk
    from rig.web.server import serve

    read_bench(bench_file)  # told now rather than on a page
    if host not in HERE:
        note(
            f"Listening at {host}: other machines can reach the workbench, and the rig with it. Nothing is encrypted; "
            "over a network that others use, leave out --host and come by `ssh -L`."
        )

    def ready(place: Place) -> None:
        if as_json:
            click.echo(json.dumps({"schema": "rig.web/1", "url": place.url, "host": place.host, "port": place.port}))
        else:
            click.echo(f"The workbench is at {place.url}\nCtrl-C ends it.")
        if not no_open and not as_json:
            webbrowser.open(place.url)

    serve(Desk(bench_file), host, port, ready)
