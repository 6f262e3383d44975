"""Data, a model and the effects of a request: a table of rows, or a still record."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from calibrations.discovery.dataset import Dataset
from calibrations.discovery.input_doubts import doubts
from calibrations.discovery.plausibility import doubt
from calibrations.discovery.rows import Rows
from calibrations.effects import Effect
from calibrations.errors import DataError, ModelError
from calibrations.fitting import table_noise
from calibrations.fitting.table_noise import with_noise
from calibrations.geometry.rate_table import earth_rate_warning
from calibrations.importing.units import UNITS, parse_unit
from calibrations.means.noise import correlation_known
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.table import Table
from rig.errors import UnknownRun
from rig.services.request import Request, effects_of
from rig.services.tables import BESIDE, load

if TYPE_CHECKING:
    from calibrations.noise.record import Samples, Still
    from rig.services.still import SampleStream

Tell = Callable[[str], None]
CHANNELS = {f"{letter}{axis}{end}" for letter in ("v", "a", "g", "m", "") for axis in "xyz" for end in ("", "_v")}
LONGEST_BEGINNING = 1 << 16  # characters
TRIADS = ({"ax", "ay", "az"}, {"mx", "my", "mz"})  # with times: a raw log of positions, unless a noise model is named


@dataclass(frozen=True)
class AnalysisInput:
    """Data, the model to compare with them, and the effects that may be missing."""

    data: Dataset[Any]
    model: Model
    effects: Mapping[str, Effect]


def load_request(request: Request, notify: Tell) -> AnalysisInput:
    """Data, model (by default that of the kind of data) and effects; `notify` receives remarks for a person.

    The data are a still record if their kind is still, if they are an array, or if a noise model is named.
    Raises DataError, RecordError, ModelError, UnknownName.
    """
    effects = effects_of(request.bench_file)
    model = read_model(request.model, effects) if request.model is not None else None
    data = (
        _load_still(request, model, notify)
        if is_noise(model) or is_still(request.data)
        else _rows(request, effects, notify)
    )
    if model is not None:
        check_unit(model, data.unit, data.source)
    return AnalysisInput(data, model or read_model(data.default_model, effects), effects)


def loaded_table(request: Request, notify: Tell) -> tuple[Table, Model, Mapping[str, Effect]]:
    """As `load_request`, for questions that only a table of rows can answer."""
    effects = effects_of(request.bench_file)
    rows = _rows(request, effects, notify)
    model = read_model(request.model or rows.default_model, effects)
    check_unit(model, rows.unit, rows.source)
    return rows.table, model, effects


def with_known_noise(table: Table, noise: str | None, effects: Mapping[str, Effect]) -> Table:
    """The table with the slow noise that a noise model gives its outputs, where one is named."""
    return table if noise is None else with_noise(table, read_model(noise, effects))


def _rows(request: Request, effects: Mapping[str, Effect], notify: Tell) -> Rows:
    """The table of a request, with remarks on its noise."""
    if request.channel or request.rate_hz:
        raise DataError(
            f"{request.data}: --channel and --rate are for still records only; this is not one (for samples at "
            "rest, give --model still)"
        )
    table = with_known_noise(load(request.data, notify=notify), request.noise, effects)
    if table.type.stage_angles and not correlation_known(table):
        notify(
            f"{table.source}: the correlation of the samples in a mean is unknown. The fit assumes independent "
            "samples, and adds any further scatter of the poses to the noise. Give the constants "
            "filter_corner_hz and sample_rate_hz."
        )
    remarks = (earth_rate_warning(table), table_noise.scatter_remark(table), doubt(table), *doubts(table))
    for remark in filter(None, remarks):
        notify(f"{table.source}: {remark}.")
    return Rows(table)


def _load_still(request: Request, model: Model | None, notify: Tell) -> Dataset[Any]:
    from calibrations.noise.dataset import StillRecord  # a table needs no noise engine
    from calibrations.noise.fit import noise_terms

    if request.noise is not None:
        raise ModelError("--noise is for poses and rates; for a still record, give --model")
    if model is not None:
        noise_terms(model)
    return StillRecord(still_of(request, notify))


def still_of(
    request: Request,
    notify: Tell,
    every_deviation: bool = False,
    keep: dict[str, list[NDArray[Any]]] | None = None,
) -> Still:
    """The still record of a request, each channel read once.

    `every_deviation`: with the modified, Hadamard and total deviations. `keep` takes all blocks by axis, if given.
    Raises DataError, RecordError, TooFewRows.
    """
    from calibrations.noise.record import reduce_record
    from rig.record.store import Record
    from rig.services.still import axes, repairs

    data = request.data
    with nullcontext() if Path(data).exists() or data.endswith(".npy") else Record.to_find(data) as record:
        streams = axes(record, data, request.channel, request.rate_hz)
        first = next(iter(streams.values()))
        samples = (_samples(axis, axis_stream, keep) for axis, axis_stream in streams.items())
        still = reduce_record(samples, first.source, first.constants, every_deviation)
    scales = {axis: axis_stream.sensed for axis, axis_stream in streams.items()}  # known when read
    sensed = {axis: scale for axis, scale in scales.items() if scale is not None}
    channels = {axis_stream.channel for axis_stream in streams.values()}
    if other_names := [name for name in first.others if name not in channels]:
        notify(f"{still.source}: {', '.join(channels)}; --channel takes another: {', '.join(other_names)}.")
    for text in repairs(first, still.n):
        notify(text)
    if np.isfinite(first.corner_hz):
        notify(
            f"The coefficients describe the noise before the {first.corner_hz:g} Hz low-pass of the output. "
            f"The fit uses frequencies below {first.corner_hz / 2:.3g} Hz."
        )
    return replace(still, sensed=sensed)


def _samples(axis: str, stream: SampleStream, keep: dict[str, list[NDArray[Any]]] | None) -> Samples:
    from calibrations.noise.record import Samples

    blocks = stream.blocks if keep is None else _keep_blocks(stream.blocks, keep.setdefault(axis, []))
    hint = f" (--channel takes another: {', '.join(stream.others)})" if stream.others else ""
    return Samples(
        axis, blocks, stream.rate_hz, stream.unit, stream.corner_hz, stream.logged, f"{stream.channel}{hint}"
    )


def _keep_blocks(blocks: Iterator[NDArray[Any]], keep: list[NDArray[Any]]) -> Iterator[NDArray[Any]]:
    for block in blocks:
        keep.append(block)
        yield block


def is_still(data: str) -> bool:
    """Whether `data` names a still record: an array, a run of that kind, a table with its columns."""
    path = Path(data)
    if path.suffix == ".npy":
        return True
    if path.exists():
        return path.is_file() and _has_channels_alone(path)
    from rig.record.measured import MeasuredRun
    from rig.record.store import Record  # a file needs no database

    with suppress(UnknownRun), Record.to_find(data) as record:
        return MeasuredRun.named(record, data).run.kind == "still"
    return False


def is_noise(model: Model | None) -> bool:
    """Whether a model is one of a still record: of noise, and possibly of the bias over temperature.

    Raises ModelError for one of noise and of other effects on samples.
    """
    if model is None:
        return False
    noise = [term.name for term in model.terms if term.effect.is_noise]
    if not noise:
        return False
    from calibrations.noise.signal import acts_on_record  # a table needs no noise engine

    other_effects = [t.name for t in model.terms if not (t.effect.is_noise or acts_on_record(t.effect))]
    if other_effects:
        raise ModelError(
            f"{model.name}: {', '.join(noise)} is a noise effect, and the model has other effects too: "
            f"{', '.join(other_effects)}; put them into separate models"
        )
    return True


def _has_channels_alone(path: Path) -> bool:
    """Only the header of a file is read."""
    with path.open(encoding="utf-8", errors="replace") as file:
        return channels_alone(file.read(LONGEST_BEGINNING))


def channels_alone(beginning: str) -> bool:
    """Whether the text of a table has times or a rate, outputs of a sensor, and no column of its orientation."""
    constants, names = _read_header(beginning.splitlines())
    columns = set(names)
    timed = "t_s" in columns or "sample_rate_hz" in constants
    channels = columns - set(BESIDE)
    return timed and bool(channels) and channels <= CHANNELS and not any(triad <= columns for triad in TRIADS)


def _read_header(lines: list[str]) -> tuple[set[str], list[str]]:
    """(constants above a table's header, names in the header)."""
    comment_lines = list(takewhile(lambda line: line.startswith("#"), lines))
    header = lines[len(comment_lines)] if len(lines) > len(comment_lines) else ""
    names = [name.strip().strip('"') for name in header.replace(";", ",").replace("\t", ",").split(",")]
    return {line.lstrip("# ").partition(":")[0].strip() for line in comment_lines}, names


def check_unit(model: Model, unit: str, source: str) -> None:
    """Raises ModelError where the values of a model are for outputs in another unit: counts or mV, not V."""
    model_unit, data_unit = (UNITS.get(parse_unit(unit_text), unit_text) for unit_text in (model.unit, unit))
    if model.params and model_unit and model_unit != data_unit:
        raise ModelError(
            f"{model.name}: its values are for outputs in {model.unit}, and {source} is in {unit}; "
            "take a model that was fitted to data in this unit, or a shipped one (`rig models`)"
        )
