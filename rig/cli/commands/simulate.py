"""simulate: serve the simulated instruments in real time for any client."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from pathlib import Path
from types import FrameType

import click

from calibrations.text import columns
from drivers.clock import WallClock, serve_forever
from drivers.manual_stage.person import PERSON
from drivers.transport import Address
from drivers.transport.server import Server
from rig.bench import Bench, read_bench
from rig.cli.terminal.output import bench_option, json_option, note
from rig.errors import BenchError
from rig.instruments.wiring import serve, world_of


@click.command("simulate")
@bench_option
@json_option
def command(bench_file: Path | None, as_json: bool) -> None:
    """Serve the simulated instruments of the bench in real time until Ctrl-C; print their addresses.

    In the bench file, `url: simulated:rtu+tcp://127.0.0.1:5021` sets a port, `simulated:pty:` a pseudo-terminal.
    """
    bench = read_bench(bench_file)
    with ExitStack() as stack:
        ended = stack.enter_context(_signalled())
        clock = WallClock()
        servers = list(serve(bench, world_of(bench)).values())
        for server in servers:
            stack.callback(server.close)
        addresses = _served(bench, servers)
        documents = {role: _document(bench, role, asdict(address)) for role, address in addresses.items()}
        _tell(documents, as_json)
        serve_forever(servers, lambda: bool(ended), clock)


@contextmanager
def _signalled() -> Iterator[list[int]]:
    """The stop signals received so far; inside, they do not end the process."""
    received: list[int] = []

    def end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        received.append(number)

    before = {each: signal.signal(each, end) for each in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield received
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def _served(bench: Bench, servers: list[Server]) -> dict[str, Address]:
    """The address of each role, without stages that a person moves. Raises BenchError if nothing can be served."""
    addresses = {role: address for server in servers for role, address in server.addresses.items()}
    by_hand = sorted(role for role, address in addresses.items() if address.url == PERSON)
    if by_hand:
        note(f"{', '.join(by_hand)}: moved by hand, so it is not served")
    if len(by_hand) == len(addresses):
        raise BenchError(
            f"no instrument of {bench.name!r} can be served; write `url: simulated` for one with an interface"
        )
    return {role: address for role, address in addresses.items() if role not in by_hand}


def _document(bench: Bench, role: str, address: dict[str, object]) -> dict[str, object]:
    given = {key: value for key, value in address.items() if value is not None}
    return {"driver": bench.instruments[role].driver, **given}


def _tell(instruments: dict[str, dict[str, object]], as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps({"schema": "rig.addresses/1", "instruments": instruments}))
    else:
        rows = [(role, i["driver"], i["url"], i["unit"], i.get("stream_url", "")) for role, i in instruments.items()]
        click.echo(columns(("role", "driver", "url", "unit", "stream"), rows))
        note("serving until Ctrl-C")
