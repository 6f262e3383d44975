"""check: connect to every instrument of the bench, identify and test it; list certificates."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import click

from calibrations.text import columns
from drivers.instrument import Check, Identity
from rig.bench import DEFAULT, read_bench
from rig.bench.certificates import EXPIRED, certificates, expired
from rig.bench.file import HAND
from rig.cli.terminal.output import bench_option, emit, json_option, notes
from rig.instruments.instruments import checked

NOT_MET, FAILED = 1, 3


@click.command("check")
@bench_option
@click.option("--example", is_flag=True, help="Print the bench file of the simulated rig, as a start for your own.")
@click.option(
    "--example-hand", is_flag=True, help="Print the bench file of a simulated sensor in a hand, without stages."
)
@json_option
def command(bench_file: Path | None, example: bool, example_hand: bool, as_json: bool) -> int:
    """Connect to every instrument of the bench, identify it and run its self-test.

    Exit status 1: an instrument's certificate has expired. 3: an instrument does not answer, or fails its self-test.
    """
    if example or example_hand:
        click.echo((HAND if example_hand else DEFAULT).read_text(encoding="utf-8"), nl=False)
        return 0
    bench = read_bench(bench_file)
    found, due = checked(bench), certificates(bench)
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
    if not all(test.ok for _, tests in found.values() for test in tests):
        return FAILED
    return NOT_MET if late else 0


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
