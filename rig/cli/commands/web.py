"""web: the workbench in a browser: models, runs, record and comparison."""

from __future__ import annotations

import json
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibrations.text import join_words
from rig.cli.terminal.output import FILE, json_option, note

if TYPE_CHECKING:
    from rig.web.server import Place

LOCAL_HOSTS = ("127.0.0.1", "localhost", "::1")


@click.command("web")
@click.option(
    "--port", type=click.IntRange(1, 65535), help="Port. Default: that of the last start, else 8473 or any free one."
)
@click.option(
    "--host",
    default=LOCAL_HOSTS[0],
    show_default=True,
    help="Address to listen at. Another address opens the workbench to other machines.",
)
@click.option("--no-open", is_flag=True, help="Print the address and open no browser.")
@click.option("--new-token", is_flag=True, help="Make a new token: older addresses and open pages stop working.")
@click.option(
    "--bench",
    "bench_files",
    multiple=True,
    type=FILE,
    help="A bench file; give it again for each rig that the page Run offers. Without it, two simulated rigs.",
)
@json_option
def web_command(
    port: int | None, host: str, no_open: bool, new_token: bool, bench_files: tuple[Path, ...], as_json: bool
) -> None:
    """Serve the workbench until Ctrl-C; print its address, and open it in the browser.

    The address contains a token; the server answers no request without it. The token is stored for this user, so the
    address stays valid. Only this machine can connect, unless --host gives another address: then anyone who can read
    the network traffic can read the token. A run continues after the server ends.
    """
    from rig.bench import read_bench
    from rig.bench.file import DEMO
    from rig.web.desk import Desk
    from rig.web.guard import kept_token
    from rig.web.server import serve

    benches = bench_files or (None, DEMO)
    for bench_file in benches:
        read_bench(bench_file)  # an error appears here and not on a page
    if host not in LOCAL_HOSTS:
        note(
            f"Listening at {host}: other machines can reach the workbench and the rig. Nothing is encrypted; "
            "in a shared network, leave out --host and connect by `ssh -L`."
        )

    def ready(place: Place) -> None:
        if as_json:
            click.echo(json.dumps({"schema": "rig.web/1", "url": place.url, "host": place.host, "port": place.port}))
        else:
            click.echo(f"The workbench is at {place.url}\nCtrl-C ends it.")
        if place.taken:
            note(
                f"Another program, perhaps another workbench, uses port {join_words(map(str, place.taken))}. The next "
                f"start takes port {place.port} again, so this address stays valid. --port chooses a port."
            )
        if not no_open and not as_json:
            webbrowser.open(place.url)

    serve(Desk(benches[0], benches), host, port, kept_token(new_token), ready)
