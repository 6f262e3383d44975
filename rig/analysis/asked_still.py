"""What the analysis of still records is asked: the record of one sensor, a noise model, the effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path

import numpy as np

from calibrations.effect import Effect
from calibrations.errors import DataError, ModelError
from calibrations.model import Model
from calibrations.model_file import read_model
from calibrations.still.fit import noise_terms
from calibrations.still.record import Samples, Still, reduced
from rig.analysis.asked import DEFAULTS, check_unit, effects_of
from rig.analysis.request import Request
from rig.analysis.still import axes
from rig.analysis.stream import BESIDE, Stream, repairs
from rig.errors import UnknownRun
from rig.record.measured import Measured
from rig.record.store import Record

CHANNELS = {f"{what}{axis}{end}" for what in ("v", "a", "g", "m", "") for axis in "xyz" for end in ("", "_v")}
LONGEST_BEGINNING = 1 << 16  # characters
TRIADS = ({"ax", "ay", "az"}, {"mx", "my", "mz"})  # with times: a raw log of positions, unless a noise model is named


@dataclass(frozen=True)
class AskedStill:
    """A still record, the model that it is set beside, and the effects that may be missing."""

    still: Still
    model: Model
    effects: Mapping[str, Effect]


def asked_still(request: Request, tell: Callable[[str], None]) -> AskedStill | None:
    """None where the data are no still record: then they are a table of another kind.

    They are one where their kind is still, an array, or a model of noise is named. `tell` hears what was done to them.
    Raises DataError, RecordError, ModelError, UnknownName.
    """
    effects = effects_of(request.bench_file)
    chosen = read_model(request.model, effects) if request.model is not None else None
    if not (_is_noise(chosen) or is_still(request.data)):
        if request.channel or request.rate_hz:
            raise DataError(
                f"{request.data}: --channel and --rate are for still records, and this is none (or name --model still)"
            )
        return None
    if request.noise is not None:
        raise ModelError("--noise is for poses and rates; the model of a still record is named with --model")
    if chosen is not None:
        noise_terms(chosen)
    still = still_of(request, tell)
    if chosen is not None:
        check_unit(chosen, still.unit, still.source)
    return AskedStill(still, chosen or read_model(DEFAULTS["still"], effects), effects)


def still_of(request: Request, tell: Callable[[str], None]) -> Still:
    """The still record that is asked of, each channel read once. Raises DataError, RecordError, TooFewRows."""
    data = request.data
    with nullcontext() if Path(data).exists() or data.endswith(".npy") else Record.to_find(data) as record:
        streams = axes(record, data, request.channel, request.rate_hz)
        first = next(iter(streams.values()))
        still = reduced((_samples(axis, each) for axis, each in streams.items()), first.source, first.constants)
    sensed = {axis: found for axis, each in streams.items() if (found := each.sensed) is not None}  # known when read
    taken = {each.channel for each in streams.values()}
    if others := [name for name in first.others if name not in taken]:
        tell(f"{still.source}: {', '.join(taken)}; --channel takes another: {', '.join(others)}.")
    for text in repairs(first, still.n):
        tell(text)
    if np.isfinite(first.corner_hz):
        tell(
            f"Coefficients are those before the output's {first.corner_hz:g} Hz low-pass, "
            f"from what is slower than {first.corner_hz / 2:.3g} Hz."
        )
    return replace(still, sensed=sensed)


def is_still(data: str) -> bool:
    """Whether what `data` names is a still record by itself: an array, a run of that kind, a table with its columns."""
    path = Path(data)
    if path.suffix == ".npy":
        return True
    if path.exists():
        return path.is_file() and _has_channels_alone(path)
    with suppress(UnknownRun), Record.to_find(data) as record:
        return Measured.named(record, data).run.kind == "still"
    return False


def _samples(axis: str, stream: Stream) -> Samples:
    return Samples(axis, stream.blocks, stream.rate_hz, stream.unit, stream.corner_hz, stream.logged)


def _is_noise(model: Model | None) -> bool:
    """Whether a model is one of noise. Raises ModelError for one of noise and of what acts on samples."""
    if model is None:
        return False
    noise = [term.name for term in model.terms if "still" in term.effect.kinds]
    if noise and len(noise) < len(model.terms):
        raise ModelError(
            f"{model.name}: {', '.join(noise)} is noise of a still record, and the other effects act on samples; "
            "keep them in models of their own"
        )
    return bool(noise)


def _has_channels_alone(path: Path) -> bool:
    """No more of a file is read than its header, whatever it is."""
    with path.open(encoding="utf-8", errors="replace") as file:
        return channels_alone(file.read(LONGEST_BEGINNING))


def channels_alone(beginning: str) -> bool:
    """Whether the text of a table has times or a rate, outputs of a sensor, and nothing that says how it was held."""
    stated, names = _beginning(beginning.splitlines())
    given = set(names)
    timed = "t_s" in given or "sample_rate_hz" in stated
    channels = given - set(BESIDE)
    return timed and bool(channels) and channels <= CHANNELS and not any(each <= given for each in TRIADS)


def _beginning(lines: list[str]) -> tuple[set[str], list[str]]:
    """(constants above a table's header, names in the header)."""
    above = list(takewhile(lambda line: line.startswith("#"), lines))
    header = lines[len(above)] if len(lines) > len(above) else ""
    names = [name.strip().strip('"') for name in header.replace(";", ",").replace("\t", ",").split(",")]
    return {line.lstrip("# ").partition(":")[0].strip() for line in above}, names
