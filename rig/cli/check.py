"""check: connect to every instrument of the bench, identify and test it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from drivers.instrument import Check, Identity
from rig.bench import DEFAULT, read_bench
from rig.cli.output import bench_option, columns, emit, json_option
from rig.instruments import checked, connected

FAILED = 3
# A stage that does not know its zero is homed by the procedure that needs it: worth a word, no fault.
REMARKS = ("coordinates",)


@click.command("check")
@bench_option
@click.option("--example", is_flag=True, help="Print the simulated rig's bench file, to begin your own with.")
@json_option
def command(bench_file: Path | None, example: bool, as_json: bool) -> int:
    """Connect to every instrument of the bench, identify it and let it test itself."""
    if example:
        click.echo(DEFAULT.read_text(encoding="utf-8"), nl=False)
        return 0
    bench = read_bench(bench_file)
    with connected(bench) as rig:
        found = checked(rig)
    if as_json:
        emit({"schema": "rig.check/1", "bench": bench.name, "instruments": _document(found)})
    else:
        rows = [row for role, (identity, tests) in found.items() for row in _rows(role, identity, tests)]
        click.echo(columns(("role", "instrument", "check", "result", "detail"), rows))
    return 0 if all(_passed(test) for _, tests in found.values() for test in tests) else FAILED


def _passed(test: Check) -> bool:
    return test.ok or test.name in REMARKS


def _rows(role: str, identity: Identity | None, tests: list[Check]) -> list[tuple[str, ...]]:
    who = " ".join(part for part in asdict(identity).values() if part) if identity else "does not answer"
    heads = [(role, who)] + [("", "")] * (len(tests) - 1)
    return [(*head, test.name, _verdict(test), test.detail) for head, test in zip(heads, tests, strict=True)]


def _verdict(test: Check) -> str:
    if test.ok:
        return "ok"
    return "note" if _passed(test) else "FAILED"


def _document(found: dict[str, tuple[Identity | None, list[Check]]]) -> dict[str, object]:
    return {
        role: {"identity": asdict(identity) if identity else None, "checks": [asdict(test) for test in tests]}
        for role, (identity, tests) in found.items()
    }
