"""fleet: what thousands of sensors miss, by batch and by rig, and their calibrations in the light of siblings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rig.cli.terminal.output import bench_option, emit, json_option, note

if TYPE_CHECKING:
    from rig.fleet.members import Member
    from rig.fleet.questions import Fleet


@click.group("fleet")
def command() -> None:
    """Judge and calibrate many sensors at once.

    SOURCES are an index (a CSV file with the columns sensor, batch, rig, file), a folder of tables, tables, or runs;
    without any, the last complete run of every sensor in the record. What was worked out is in the record, so a command
    that was stopped goes on where it was when it is given again.
    """


def _fleet_options(function: Callable[..., Any]) -> Callable[..., Any]:
    options = (
        click.argument("sources", nargs=-1),
        click.option("--scheduler", metavar="tcp://HOST:PORT", help="Dask's scheduler; else a local cluster."),
        click.option("--workers", type=click.IntRange(min=1), help="Of the local cluster; else one for each core."),
        click.option("--report", type=click.Path(dir_okay=False, path_type=Path), help="Write a page on the fleet."),
        bench_option,
        json_option,
    )
    for option in reversed(options):
        function = option(function)
    return function


@command.command("discover")
@_fleet_options
@click.option("--model", default="linear", show_default=True, help="That sensors are held against: a name or a file.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), help="Write each batch's model here.")
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
    """Find what the sensors of SOURCES miss: effects of batches, errors of rigs, and sensors unlike their siblings."""
    from calibrations.model.file import dump_model, read_model
    from rig.cli.terminal.fleet_words import population
    from rig.files import require_out, write_whole
    from rig.fleet.calibrate import write_guide
    from rig.fleet.discover import discover_fleet
    from rig.fleet.documents import population_document
    from rig.fleet.own_effects import effects_of, own_files
    from rig.fleet.worker import Question

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
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), help="Write each sensor's model here.")
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
    """Calibrate the sensors of SOURCES, each in the light of its batch, with intervals that hold 95 %."""
    from calibrations.model.file import dump_model
    from rig.cli.terminal.fleet_words import calibration
    from rig.files import require_out, write_whole
    from rig.fleet.calibrate import calibrate_fleet, made_folder, models, read_guide, safe
    from rig.fleet.documents import calibration_document
    from rig.fleet.own_effects import own_files

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
        told = [f"written: {len(written)} files, such as {written[-1]}"] if written else []
        click.echo("\n".join([*calibration(found), *told]))


@contextmanager
def _fleet(sources: Sequence[str], scheduler: str | None, workers: int | None) -> Iterator[tuple[Fleet, list[Member]]]:
    """The workers and the sensors; how far it is goes to standard error, in steps of a tenth."""
    from rig.fleet.crew import crew
    from rig.fleet.members import fleet_of
    from rig.fleet.questions import Fleet
    from rig.record import Record

    members = fleet_of(sources)
    note(f"{len(members)} sensors of {len({m.batch for m in members})} batches on {len({m.rig for m in members})} rigs")
    with Record() as record, crew(scheduler, workers) as client:
        yield Fleet(client, record, _Steps()), members


class _Steps:
    """Tells every tenth of a round."""

    def __init__(self) -> None:
        self._told = (0, 0)

    def __call__(self, done: int, of: int) -> None:
        step = (of, 10 * done // of)
        if step != self._told:
            self._told = step
            note(f"{done} of {of} sensors looked at")
