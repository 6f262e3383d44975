"""fleet: find the missing effects of thousands of sensors, and calibrate each with the statistics of its batch."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibrations.fleet.batch import BatchEffect, Population, SensorVerdict
from calibrations.model.file import dump_model, read_model
from calibrations.text import columns, concise, concise_in_prefix, count_words, join_words, percent
from rig.cli.terminal.complete import complete_model
from rig.cli.terminal.output import FOLDER, bench_option, emit, json_option, note, out_option, require_outputs
from rig.files import write_whole
from rig.fleet.calibrate import (
    CalibratedBatch,
    FleetCalibration,
    calibrate_fleet,
    read_guide,
    write_guide,
    write_models,
)
from rig.fleet.cluster import connect_workers
from rig.fleet.discover import discover_fleet
from rig.fleet.members import fleet_of
from rig.fleet.questions import Fleet
from rig.fleet.worker import Question, effects_of, own_files
from rig.record import Record

if TYPE_CHECKING:
    from rig.fleet.members import Member


@click.group("fleet")
def fleet_command() -> None:
    """Analyse and calibrate many sensors at once.

    SOURCES are an index (a CSV file with the columns sensor, batch, rig, file), a folder of tables, tables, or runs;
    without SOURCES, the last complete run of every sensor in the record. The record stores every result, so a stopped
    command continues when you repeat it.
    """


@dataclass(frozen=True)
class Request:
    """The words of a command on a fleet."""

    sources: tuple[str, ...]
    scheduler: str | None
    workers: int | None
    report: Path | None
    bench_file: Path | None
    as_json: bool
    model: str
    out: Path | None


def _fleet_options(model: str, out: str) -> Callable[[Callable[[Request], None]], Callable[..., None]]:
    """The arguments of both commands, as a Request; `model` and `out` are the help of these options."""
    options = (
        click.argument("sources", nargs=-1),
        click.option("--scheduler", metavar="tcp://HOST:PORT", help="Dask scheduler. Default: a local cluster."),
        click.option(
            "--workers", type=click.IntRange(min=1), help="Size of the local cluster. Default: one worker a core."
        ),
        out_option("Write a report on the fleet to this HTML file.", "--report"),
        bench_option,
        json_option,
        click.option("--model", default="linear", shell_complete=complete_model, show_default=True, help=model),
        click.option("--out", type=FOLDER, help=out),
    )

    def decorated(function: Callable[[Request], None]) -> Callable[..., None]:
        @wraps(function)
        def decorated_command(**words: Any) -> None:
            function(Request(**words))

        for option in reversed(options):
            decorated_command = option(decorated_command)
        return decorated_command

    return decorated


@fleet_command.command("discover")
@_fleet_options("Model to test: a name or a file.", "Write the model of each batch into this folder.")
def discover(request: Request) -> None:
    """Find effects that batches miss, errors of rigs, and sensors unlike the others of their batch."""
    from rig.fleet.documents import population_document, population_page

    effect_files, model = own_files(request.bench_file), request.model
    start = Question("look", dump_model(read_model(model, effects_of(effect_files))), own=effect_files)
    with _fleet(request) as (fleet, members):
        result = discover_fleet(fleet, members, start)
    paths = write_guide(result, start, request.out) if request.out is not None else []
    _write_report(request, paths, lambda: population_page(result, model))
    if request.as_json:
        emit(population_document(result, model) | {"written": [str(path) for path in paths]})
    else:
        click.echo("\n".join([*population(result, model), *(f"written: {path}" for path in paths)]))


@fleet_command.command("calibrate")
@_fleet_options("A name, a file, or the folder of fleet discover.", "Write the model of each sensor into this folder.")
def calibrate(request: Request) -> None:
    """Calibrate the sensors of SOURCES with the statistics of their batch, with 95 % intervals."""
    from rig.fleet.documents import calibration_document, calibration_page

    effect_files, model = own_files(request.bench_file), request.model
    with _fleet(request) as (fleet, members):
        result = calibrate_fleet(fleet, members, read_guide(model, {member.batch for member in members}, effect_files))
    model_paths = write_models(result, request.out) if request.out is not None else []
    _write_report(request, model_paths, lambda: calibration_page(result, model))
    if request.as_json:
        emit(calibration_document(result, model) | {"written": [str(path) for path in model_paths]})
    else:
        paths = [f"written: {len(model_paths)} files, such as {model_paths[-1]}"] if model_paths else []
        click.echo("\n".join([*calibration(result), *paths]))


def _write_report(request: Request, paths: list[Path], page: Callable[[], str]) -> None:
    """Write the `page` if --report is given, and add it to the `paths` files."""
    if request.report is not None:
        write_whole(request.report, page())
        paths.append(request.report)


@contextmanager
def _fleet(request: Request) -> Iterator[tuple[Fleet, list[Member]]]:
    """The workers and the sensors; progress goes to standard error. Raises OutputError for an unusable report file."""
    if request.out is not None:
        require_outputs(*sorted(request.out.glob("*.yaml")))
    members = fleet_of(request.sources)
    batches, rigs = {m.batch for m in members}, {m.rig for m in members}
    note(
        f"{count_words(len(members), 'sensor', 'sensors')} of {count_words(len(batches), 'batch', 'batches')} "
        f"on {count_words(len(rigs), 'rig', 'rigs')}"
    )
    with Record() as record, connect_workers(request.scheduler, request.workers) as client:
        yield Fleet(client, record, _Steps()), members


class _Steps:
    """Prints the progress at every tenth of a step."""

    def __init__(self) -> None:
        self._printed = ("", 0)

    def __call__(self, step: str, count: int, total: int) -> None:
        tenth = (step, 10 * count // total)
        if count and tenth != self._printed:
            self._printed = tenth
            note(f"{step}: {count} of {total} sensors")


# Results in words.


MOST_SENSORS = 20
VERDICTS = ("adequate", "effect-missing", "ambiguous", "unexplained", "no-response", "failed")


def population(result: Population, model: str) -> Iterator[str]:
    """The result of `rig fleet discover`."""
    counts = ", ".join(f"{result.verdicts[v]} {v}" for v in VERDICTS if result.verdicts[v])
    yield f"{model} on {len(result.sensors)} sensors: {counts}"
    rows = [
        (b.batch or "-", b.sensors, _list_shared(b.effects), _shares(b.shares, {e.effect for e in b.effects}))
        for b in result.batches
    ]
    yield ""
    yield columns(("batch", "sensors", "missing in all", "missing in some"), rows)
    yield from _rigs(result)
    yield from _persons([sensor for sensor in result.sensors if sensor.needs_a_person])


def _list_shared(effects: Iterable[BatchEffect]) -> str:
    return ", ".join(_with_rivals(effect.effect, effect.rivals) for effect in effects) or "nothing"


def _with_rivals(name: str, rivals: Iterable[str]) -> str:
    rival_names = list(rivals)
    return f"{name} (or {join_words(rival_names)})" if rival_names else name


def _shares(shares: Mapping[str, float], shared: set[str]) -> str:
    return ", ".join(f"{name} {percent(share)}" for name, share in shares.items() if name not in shared) or "-"


def _rigs(result: Population) -> Iterator[str]:
    faulty = [error for error in result.rigs if error.beyond]
    if faulty:
        yield ""
        yield "Errors of rigs relative to their median; the poses were corrected for them:"
        rows = [(e.rig, e.effect, concise_in_prefix(e.value, e.std, e.unit), e.parameter, e.sensors) for e in faulty]
        yield columns(("rig", "effect", "value", "parameter", "sensors"), rows)
    rigs = {rig for group in result.unconnected for rig in group}
    if len(rigs) == 1:
        yield ""
        yield "All sensors were measured on one rig: an error of its stages looks like an error of all sensors."
    elif len(result.unconnected) > 1:
        yield ""
        groups = "; ".join(join_words(group) for group in result.unconnected)
        yield f"These groups of rigs cannot be compared, because no batch was measured on two of them: {groups}."


def _persons(sensors: list[SensorVerdict]) -> Iterator[str]:
    if not sensors:
        return
    yield ""
    order = sorted(sensors, key=lambda s: (VERDICTS.index(s.verdict), len(s.own)), reverse=True)
    rest_text = f"; the first {MOST_SENSORS}" if len(order) > MOST_SENSORS else ""
    yield f"{len(order)} sensors need a decision by a person{rest_text}:"
    rows = [(s.sensor, s.batch or "-", s.rig or "-", s.verdict, reason_of(s)) for s in order[:MOST_SENSORS]]
    yield columns(("sensor", "batch", "rig", "verdict", "why"), rows)


def reason_of(sensor: SensorVerdict) -> str:
    """The reason why a sensor needs a person."""
    effect_texts = [_with_rivals(name, sensor.rivals.get(name, ())) for name in (sensor.own or sensor.effects)]
    return "; ".join(filter(None, (", ".join(effect_texts), sensor.remark))) or "-"


def calibration(result: FleetCalibration) -> Iterator[str]:
    """The result of `rig fleet calibrate`."""
    for batch in result.batches:
        yield from (*_batch(batch), "")
    for member, fault in result.faults.items():
        yield f"{member.sensor} is not calibrated: {fault}"


def _batch(batch: CalibratedBatch) -> Iterator[str]:
    yield f"batch {batch.batch or '-'}: {len(batch.members)} sensors"
    rows = []
    for (effect, name, axis, unit), parameter, size, gain in zip(
        batch.names, batch.pooled.parameters, batch.pooled.scale, batch.gains, strict=True
    ):
        mean = concise(parameter.mean * size, parameter.mean_std * size, unit)
        spread = f"{parameter.spread * size:.2g} {unit}"
        outliers = _sensor_list(batch.marked(parameter.outliers))
        rows.append((effect, name, axis or "-", mean, spread, f"{gain:.2f}", outliers))
    yield columns(("effect", "parameter", "axis", "mean", "spread", "std / alone", "outliers"), rows)
    if any(batch.unlike):
        names = _sensor_list(batch.marked(batch.unlike))
        yield f"This model does not describe: {names}; `rig fleet discover` finds their missing effects."


def _sensor_list(sensors: list[str]) -> str:
    text = ", ".join(sensors[:5])
    return f"{text} and {len(sensors) - 5} more" if len(sensors) > 5 else text or "-"
