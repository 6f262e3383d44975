"""check: connect to every instrument of the bench, identify and test it; list certificates."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import click

from calibrations.text import columns
from drivers.errors import StageAlarm
from drivers.instrument import Check, HasAlarm, Identity, Instrument
from rig.bench import DEFAULT, read_bench
from rig.bench.certificates import EXPIRED, certificates, expired
from rig.bench.file import HAND
from rig.cli.terminal.output import bench_option, emit, json_option, notes
from rig.cli.terminal.progress import working
from rig.instruments.instruments import checked
from rig.instruments.wiring import on_a_network

NOT_MET, FAILED = 1, 3


@click.command("check")
@bench_option
@click.option("--example", is_flag=True, help="Print the bench file of the simulated rig, as a start for your own.")
@click.option(
    "--example-hand", is_flag=True, help="Print the bench file of a simulated sensor in a hand, without stages."
)
@click.option("--reset", is_flag=True, help="Show the alarm of each drive, and reset it after a question.")
@json_option
def command(bench_file: Path | None, example: bool, example_hand: bool, reset: bool, as_json: bool) -> int:
    """Connect to every instrument of the bench, identify it and run its self-test.

    --reset asks before it resets an alarm: first remove its cause. Nothing moves by a reset.

    Exit status 1: an instrument's certificate has expired. 3: an instrument does not answer, or fails its self-test.
    """
    if example or example_hand:
        click.echo((HAND if example_hand else DEFAULT).read_text(encoding="utf-8"), nl=False)
        return 0
    if reset and as_json:
        raise click.UsageError("--reset asks a person; leave out --json")
    bench = read_bench(bench_file)
    with nullcontext() if reset else working("testing the instruments"):  # a reset asks a person
        found = checked(bench, _reset if reset else None)
    due = certificates(bench)
    late = expired(bench, datetime.now(UTC).date())
    if as_json:
        papers = {
            name: {"number": certificate.number, "due": certificate.due.isoformat()}
            for name, certificate in due.items()
        }
        document = {"instruments": _document(found), "certificates": papers, EXPIRED: late}
        emit({"schema": "rig.check/1", "bench": bench.name, **document})
    else:
        rows = [row for role, (identity, tests) in found.items() for row in _rows(role, identity, tests)]
        click.echo(columns(("role", "instrument", "check", "result", "detail"), rows))
        for name, certificate in due.items():
            click.echo(f"{name}: certificate {certificate.number}, due {certificate.due}")
        notes(f"{fault}; have it calibrated again" for fault in late)
        notes(_shared(on_a_network(bench)))
    if not all(test.ok for _, tests in found.values() for test in tests):
        return FAILED
    return NOT_MET if late else 0


def _shared(roles: list[str]) -> list[str]:
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


def _rows(role: str, identity: Identity | None, tests: list[Check]) -> list[tuple[str, ...]]:
    who = " ".join(part for part in asdict(identity).values() if part) if identity else "does not answer"
    heads = [(role, who)] + [("", "")] * (len(tests) - 1)
    verdicts = ["ok" if test.ok else "FAILED" for test in tests]
    return [
        (*head, test.name, verdict, test.detail) for head, test, verdict in zip(heads, tests, verdicts, strict=True)
    ]


def _document(found: dict[str, tuple[Identity | None, list[Check]]]) -> dict[str, object]:
    return {
        role: {"identity": asdict(identity) if identity else None, "checks": [asdict(test) for test in tests]}
        for role, (identity, tests) in found.items()
    }
