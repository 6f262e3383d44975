"""check, simulate and draw: the instruments of a bench."""

from __future__ import annotations

import json
import math
import signal
from contextlib import ExitStack, nullcontext
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import click

from calibrations.text import columns
from drivers.clock import WallClock, serve_forever
from drivers.errors import StageAlarm
from drivers.instrument import Check, HasAlarm, Identity, Instrument
from drivers.transport import Address
from drivers.transport.person import PERSON
from drivers.transport.server import Server
from rig.bench import DEFAULT, Bench, read_bench
from rig.bench.certificates import EXPIRED, certificates, find_expired
from rig.bench.file import HAND
from rig.cli.terminal.output import bench_option, emit, json_option, note, notes, out_option
from rig.cli.terminal.progress import working
from rig.errors import BenchError
from rig.files import write_whole
from rig.instruments.instruments import check_all
from rig.instruments.wiring import on_a_network, serve, world_of
from rig.runs.signals import signal_handlers

NOT_MET, FAILED = 1, 3


@click.command("check")
@bench_option
@click.option("--example", is_flag=True, help="Print the bench file of the simulated rig, as a start for your own.")
@click.option(
    "--example-hand", is_flag=True, help="Print the bench file of a simulated sensor in a hand, without stages."
)
@click.option("--reset", is_flag=True, help="Show the alarm of each drive, and reset it after a question.")
@json_option
def check_command(bench_file: Path | None, example: bool, example_hand: bool, reset: bool, as_json: bool) -> int:
    """Connect to every instrument of the bench, identify it and run its self-test.

    --reset asks before it resets an alarm: first remove its cause. A reset moves nothing.

    Exit status 1: an instrument's certificate has expired. 3: an instrument does not answer, or fails its self-test.
    """
    if example or example_hand:
        click.echo((HAND if example_hand else DEFAULT).read_text(encoding="utf-8"), nl=False)
        return 0
    if reset and as_json:
        raise click.UsageError("--reset asks a person; leave out --json")
    bench = read_bench(bench_file)
    with nullcontext() if reset else working("testing the instruments"):  # a reset asks a person
        tests_by_role = check_all(bench, _reset if reset else None)
    due = certificates(bench)
    expired_papers = find_expired(bench, datetime.now(UTC).date())
    if as_json:
        papers = {
            name: {"number": certificate.number, "due": certificate.due.isoformat()}
            for name, certificate in due.items()
        }
        document = {"instruments": _check_document(tests_by_role), "certificates": papers, EXPIRED: expired_papers}
        emit({"schema": "rig.check/1", "bench": bench.name, **document})
    else:
        rows = [row for role, (identity, tests) in tests_by_role.items() for row in _check_rows(role, identity, tests)]
        click.echo(columns(("role", "instrument", "check", "result", "detail"), rows))
        for name, certificate in due.items():
            click.echo(f"{name}: certificate {certificate.number}, due {certificate.due}")
        notes(f"{fault}; have it calibrated again" for fault in expired_papers)
        notes(_network_remark(on_a_network(bench)))
    if not all(test.ok for _, tests in tests_by_role.values() for test in tests):
        return FAILED
    return NOT_MET if expired_papers else 0


def _network_remark(roles: list[str]) -> list[str]:
    """The remark about instruments that another computer could use at the same time."""
    remark = (
        f"On a network: {', '.join(roles)}. This program keeps other runs of this computer away from them, and cannot "
        "see other computers. Let one computer use them at a time, and keep their network apart."
    )
    return [remark] if roles else []


def _reset(driver: Instrument) -> None:
    """Reset the alarm of a drive if a person wants it. An alarm that stays fails the self-test afterwards."""
    if not isinstance(driver, HasAlarm):
        return
    if (alarm := driver.alarm()) is None:
        click.echo(f"{driver.name}: no alarm", err=True)
        return
    click.echo(f"{driver.name}: alarm {alarm.code:02X}, {alarm.text}. {alarm.remedy}.", err=True)
    if not alarm.resettable:
        click.echo(f"{driver.name}: no command resets this alarm; it needs a power cycle", err=True)
    elif click.confirm(f"Is the cause removed, and is nobody near the rig? Reset the alarm of {driver.name}", err=True):
        try:
            driver.reset_alarm()
        except StageAlarm as stays:
            click.echo(str(stays), err=True)
        else:
            click.echo(f"{driver.name}: the alarm is reset", err=True)


def _check_rows(role: str, identity: Identity | None, tests: list[Check]) -> list[tuple[str, ...]]:
    identification = " ".join(part for part in asdict(identity).values() if part) if identity else "does not answer"
    heads = [(role, identification)] + [("", "")] * (len(tests) - 1)
    verdicts = ["ok" if test.ok else "FAILED" for test in tests]
    return [
        (*head, test.name, verdict, test.detail) for head, test, verdict in zip(heads, tests, verdicts, strict=True)
    ]


def _check_document(tests_by_role: dict[str, tuple[Identity | None, list[Check]]]) -> dict[str, object]:
    return {
        role: {"identity": asdict(identity) if identity else None, "checks": [asdict(test) for test in tests]}
        for role, (identity, tests) in tests_by_role.items()
    }


@click.command("simulate")
@bench_option
@json_option
def simulate_command(bench_file: Path | None, as_json: bool) -> None:
    """Serve the simulated instruments of the bench in real time until Ctrl-C; print their addresses.

    In the bench file, `url: simulated:rtu+tcp://127.0.0.1:5021` sets a port, `simulated:pty:` a pseudo-terminal.
    """
    bench = read_bench(bench_file)
    stop_signals: list[int] = []
    with ExitStack() as stack:
        stack.enter_context(
            signal_handlers(lambda number, _: stop_signals.append(number), signal.SIGINT, signal.SIGTERM)
        )
        clock = WallClock()
        servers = list(serve(bench, world_of(bench)).values())
        for server in servers:
            stack.callback(server.close)
        addresses = _addresses(bench, servers)
        documents = {role: _address_document(bench, role, asdict(address)) for role, address in addresses.items()}
        _print_addresses(documents, as_json)
        serve_forever(servers, lambda: bool(stop_signals), clock)


def _addresses(bench: Bench, servers: list[Server]) -> dict[str, Address]:
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


def _address_document(bench: Bench, role: str, address: dict[str, object]) -> dict[str, object]:
    settings = {key: value for key, value in address.items() if value is not None}
    return {"driver": bench.instruments[role].driver, **settings}


def _print_addresses(instruments: dict[str, dict[str, object]], as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps({"schema": "rig.addresses/1", "instruments": instruments}))
    else:
        rows = [(role, i["driver"], i["url"], i["unit"], i.get("stream_url", "")) for role, i in instruments.items()]
        click.echo(columns(("role", "driver", "url", "unit", "stream"), rows))
        note("serving until Ctrl-C")


def _svg(context: click.Context, parameter: click.Parameter, path: Path | None) -> Path | None:  # noqa: ARG001
    if path is not None and path.suffix.lower() != ".svg":
        raise click.BadParameter(f"{path}: a drawing is an SVG file; name it {path.with_suffix('.svg').name}")
    return path


def _finite(context: click.Context, parameter: click.Parameter, deg: float) -> float:  # noqa: ARG001
    if not math.isfinite(deg):
        raise click.BadParameter(f"{deg:g} is not an angle")
    return deg


@click.command("draw")
@click.option("--alpha", default=0.0, callback=_finite, metavar="DEG", help="Angle of alpha, which tilts the table.")
@click.option("--beta", default=0.0, callback=_finite, metavar="DEG", help="Angle of beta, which turns the table.")
@click.option("--mount", default=0.0, callback=_finite, metavar="DEG", help="Rotation of the sensor about its z axis.")
@click.option("--flip", default=0, type=click.IntRange(0, 1), help="1: the sensor is mounted face down.")
@out_option("Write the drawing to this file, FILE.svg.", callback=_svg)
@json_option
def draw_command(alpha: float, beta: float, mount: float, flip: int, out: Path | None, as_json: bool) -> None:
    """Draw the stages and the mounting of the sensor, and print its specific force at rest.

    Without --out, a sketch of the table appears in the terminal.
    """
    from rig.drawings import Attitude, page, sketch

    attitude = Attitude(alpha, beta, mount, flip)
    if out is not None:
        write_whole(out, page(attitude))
    force_g = dict(zip("xyz", attitude.specific_force_g, strict=True))
    if as_json:
        emit({"schema": "rig.drawing/1", "out": str(out) if out else None, "specific_force_g": force_g})
        return
    specific_force = ", ".join(f"{axis} {value:+.4f}" for axis, value in force_g.items())
    lines = [f"written: {out}"] if out else [*sketch(attitude), "o: pin 1; view from above the table"]
    click.echo("\n".join([attitude.words, *lines, f"Specific force at rest, in g: {specific_force}"]))
