"""fleet: find the missing effects of thousands of sensors, and calibrate each with the statistics of its batch."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibrations.fleet.batch import BatchEffect, Population, SensorVerdict
from calibrations.text import columns, concise, joined, percent
from rig.cli.terminal.output import bench_option, emit, json_option, note
from rig.fleet.calibrate import Calibrated, Calibration

if TYPE_CHECKING:
    from rig.fleet.members import Member
    from rig.fleet.questions import Fleet


@click.group("fleet")
def command() -> None:
    """Analyse and calibrate many sensors at once.

    SOURCES are an index (a CSV file with the columns sensor, batch, rig, file), a folder of tables, tables, or runs;
    without SOURCES, the last complete run of every sensor in the record. The record stores every result, so a stopped
    command continues when you repeat it.
    """


def _fleet_options(function: Callable[..., Any]) -> Callable[..., Any]:
    options = (
        click.argument("sources", nargs=-1),
        click.option("--scheduler", metavar="tcp://HOST:PORT", help="Dask scheduler. Default: a local cluster."),
        click.option(
            "--workers", type=click.IntRange(min=1), help="Size of the local cluster. Default: one worker a core."
        ),
        click.option(
            "--report",
            type=click.Path(dir_okay=False, path_type=Path),
            help="Write a report on the fleet to this HTML file.",
        ),
        bench_option,
        json_option,
    )
    for option in reversed(options):
        function = option(function)
    return function


@command.command("discover")
@_fleet_options
@click.option("--model", default="linear", show_default=True, help="Model to test: a name or a file.")
@click.option(
    "--out", type=click.Path(file_okay=False, path_type=Path), help="Write the model of each batch into this folder."
)
def discover(
    sources: tuple[str, ...],
    scheduler: str | None,
    workers: int | None,
    report: Path | None,
    bench_file: Path | None,
    as_json: bool,
    model: str,
    out: Path | None,
) -> None:
    """Find effects that batches miss, errors of rigs, and sensors unlike the others of their batch."""
    from calibrations.model.file import dump_model, read_model
    from rig.files import require_out, write_whole
    from rig.fleet.calibrate import write_guide
    from rig.fleet.discover import discover_fleet
    from rig.fleet.documents import population_document
    from rig.fleet.worker import Question, effects_of, own_files

    own = own_files(bench_file)
    start = Question("look", dump_model(read_model(model, effects_of(own))), own=own)
    if report is not None:
        require_out(report, *sources)
    with _fleet(sources, scheduler, workers) as (fleet, members):
        found = discover_fleet(fleet, members, start)
    written = write_guide(found, start, out) if out is not None else []
    if report is not None:
        from rig.fleet.documents import population_page

        write_whole(report, population_page(found, model))
        written.append(report)
    if as_json:
        emit(population_document(found, model) | {"written": [str(path) for path in written]})
    else:
        click.echo("\n".join([*population(found, model), *(f"written: {path}" for path in written)]))


@command.command("calibrate")
@_fleet_options
@click.option("--model", default="linear", show_default=True, help="A name, a file, or the folder of fleet discover.")
@click.option(
    "--out", type=click.Path(file_okay=False, path_type=Path), help="Write the model of each sensor into this folder."
)
def calibrate(
    sources: tuple[str, ...],
    scheduler: str | None,
    workers: int | None,
    report: Path | None,
    bench_file: Path | None,
    as_json: bool,
    model: str,
    out: Path | None,
) -> None:
    """Calibrate the sensors of SOURCES with the statistics of their batch, with 95 % intervals."""
    from calibrations.model.file import dump_model
    from rig.files import require_out, write_whole
    from rig.fleet.calibrate import calibrate_fleet, made_folder, models, read_guide, safe
    from rig.fleet.documents import calibration_document
    from rig.fleet.worker import own_files

    if report is not None:
        require_out(report, *sources)
    own = own_files(bench_file)
    with _fleet(sources, scheduler, workers) as (fleet, members):
        found = calibrate_fleet(fleet, members, read_guide(model, {member.batch for member in members}, own))
    written: list[Path] = []
    for batch in found.batches if out is not None else ():
        for sensor, of in models(batch).items():
            written.append(made_folder(Path(out or "")) / f"{safe(sensor)}.yaml")
            write_whole(written[-1], dump_model(of))
    if report is not None:
        from rig.fleet.documents import calibration_page

        write_whole(report, calibration_page(found, model))
        written.append(report)
    if as_json:
        emit(calibration_document(found, model) | {"written": [str(path) for path in written]})
    else:
        paths = [f"written: {len(written)} files, such as {written[-1]}"] if written else []
        click.echo("\n".join([*calibration(found), *paths]))


@contextmanager
def _fleet(sources: Sequence[str], scheduler: str | None, workers: int | None) -> Iterator[tuple[Fleet, list[Member]]]:
    """The workers and the sensors; progress goes to standard error."""
    from rig.fleet.crew import crew
    from rig.fleet.members import fleet_of
    from rig.fleet.questions import Fleet
    from rig.record import Record

    members = fleet_of(sources)
    note(f"{len(members)} sensors of {len({m.batch for m in members})} batches on {len({m.rig for m in members})} rigs")
    with Record() as record, crew(scheduler, workers) as client:
        yield Fleet(client, record, _Steps()), members


class _Steps:
    """Prints the progress at every tenth of a round."""

    def __init__(self) -> None:
        self._printed = (0, 0)

    def __call__(self, done: int, of: int) -> None:
        step = (of, 10 * done // of)
        if step != self._printed:
            self._printed = step
            note(f"{done} of {of} sensors analysed")


# Results in words.


MOST_SENSORS = 20
VERDICTS = ("adequate", "effect-missing", "ambiguous", "unexplained", "no-response", "failed")


def population(found: Population, model: str) -> Iterator[str]:
    """The result of `rig fleet discover`."""
    counts = ", ".join(f"{found.verdicts[v]} {v}" for v in VERDICTS if found.verdicts[v])
    yield f"{model} on {len(found.sensors)} sensors: {counts}"
    rows = [
        (each.batch or "-", each.sensors, _shared(each.effects), _shares(each.shares, {e.effect for e in each.effects}))
        for each in found.batches
    ]
    yield ""
    yield columns(("batch", "sensors", "missing in all", "missing in some"), rows)
    yield from _rigs(found)
    yield from _persons([each for each in found.sensors if each.needs_a_person])


def _shared(effects: Iterable[BatchEffect]) -> str:
    return ", ".join(_with_rivals(each.effect, each.rivals) for each in effects) or "nothing"


def _with_rivals(name: str, rivals: Iterable[str]) -> str:
    others = list(rivals)
    return f"{name} (or {joined(others)})" if others else name


def _shares(shares: Mapping[str, float], shared: set[str]) -> str:
    return ", ".join(f"{name} {percent(share)}" for name, share in shares.items() if name not in shared) or "-"


def _rigs(found: Population) -> Iterator[str]:
    beyond = [error for error in found.rigs if error.beyond]
    if beyond:
        yield ""
        yield "Errors of rigs relative to their median; the poses were corrected for them:"
        rows = [
            (
                e.rig,
                e.effect,
                concise(e.value, e.std, e.unit),
                e.parameter,
                e.sensors,
            )
            for e in beyond
        ]
        yield columns(("rig", "effect", "value", "parameter", "sensors"), rows)
    rigs = {rig for group in found.unconnected for rig in group}
    if len(rigs) == 1:
        yield ""
        yield "All sensors were measured on one rig: an error of its stages looks like an error of all sensors."
    elif len(found.unconnected) > 1:
        yield ""
        groups = "; ".join(joined(group) for group in found.unconnected)
        yield f"These groups of rigs cannot be compared, because no batch was measured on two of them: {groups}."


def _persons(sensors: list[SensorVerdict]) -> Iterator[str]:
    if not sensors:
        return
    yield ""
    order = sorted(sensors, key=lambda each: (VERDICTS.index(each.verdict), len(each.own)), reverse=True)
    more = f"; the first {MOST_SENSORS}" if len(order) > MOST_SENSORS else ""
    yield f"{len(order)} sensors need a decision by a person{more}:"
    rows = [(each.sensor, each.batch or "-", each.rig or "-", each.verdict, why(each)) for each in order[:MOST_SENSORS]]
    yield columns(("sensor", "batch", "rig", "verdict", "why"), rows)


def why(each: SensorVerdict) -> str:
    """The reason why a sensor needs a person."""
    named = [_with_rivals(name, each.rivals.get(name, ())) for name in (each.own or each.effects)]
    return "; ".join(filter(None, (", ".join(named), each.remark))) or "-"


def calibration(found: Calibration) -> Iterator[str]:
    """The result of `rig fleet calibrate`."""
    for batch in found.batches:
        yield from (*_batch(batch), "")
    for member, fault in found.faults.items():
        yield f"{member.sensor} is not calibrated: {fault}"


def _batch(batch: Calibrated) -> Iterator[str]:
    out = [m.sensor for m, unlike in zip(batch.members, batch.unlike, strict=True) if unlike]
    yield f"batch {batch.batch or '-'}: {len(batch.members)} sensors"
    rows = []
    for (effect, name, axis, unit), each, size, gain in zip(
        batch.names, batch.pooled.parameters, batch.pooled.scale, _gains(batch), strict=True
    ):
        mean = concise(each.mean * size, each.mean_std * size, unit)
        apart = [m.sensor for m, alone in zip(batch.members, each.apart, strict=True) if alone]
        rows.append((effect, name, axis or "-", mean, f"{each.spread * size:.2g} {unit}", f"{gain:.2f}", _named(apart)))
    yield columns(("effect", "parameter", "axis", "mean", "spread", "std / alone", "outliers"), rows)
    if out:
        yield f"This model does not describe: {_named(out)}; `rig fleet discover` finds their missing effects."


def _gains(batch: Calibrated) -> list[float]:
    import numpy as np

    return list(map(float, np.median(batch.pooled.stds / batch.pooled.alone, axis=0)))


def _named(sensors: list[str]) -> str:
    shown = ", ".join(sensors[:5])
    return f"{shown} and {len(sensors) - 5} more" if len(sensors) > 5 else shown or "-"
