"""DATA of a still sensor as a stream of samples: a table, an array in a file, or a run straight from its record."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from calibrations.errors import DataError
from calibrations.table import AXES
from rig.record.measured import Measured
from rig.record.store import Record
from rig.services.data import load
from rig.services.still_run import of_run
from rig.services.still_table import of_table
from rig.services.stream import AXIS, Stream

BLOCK = 1 << 17


def stream(record: Record | None, data: str, channel: str | None, rate_hz: float | None) -> Stream:
    """The samples that `data` names. `rate_hz` is for what does not say its own.

    Raises DataError and RecordError: no such file, run or channel; a rate that is missing or disagrees; gaps.
    """
    return _source(record, data, rate_hz)(channel)


def axes(record: Record | None, data: str, channel: str | None, rate_hz: float | None) -> dict[str, Stream]:
    """The samples of one sensor's axes by their names: the one asked for, or the first axis and those that go with it.

    A channel whose name has no axis in it is called x. Raises what `stream` raises.
    """
    source = _source(record, data, rate_hz)
    first = source(channel)
    names = (first.channel, *first.others)
    named = next(filter(None, map(AXIS.fullmatch, names)), None)
    if channel is not None or named is None:
        return {_axis(first.channel): first}
    alike = [f"{named[1]}{axis}{named[3]}" for axis in AXES]
    return {_axis(name): source(name) for name in alike if name in names}


def _axis(channel: str) -> str:
    named = AXIS.fullmatch(channel)
    return named[2] if named else AXES[0]


def _source(record: Record | None, data: str, rate_hz: float | None) -> Callable[[str | None], Stream]:
    """What gives the stream of a channel; a table is read once for all of them."""
    path = Path(data)
    if path.suffix == ".npy":
        if not path.is_file():
            raise DataError(f"{data}: there is no such file; a run is named as `rig runs` lists it")
        return lambda _: _of_array(path, rate_hz)
    if path.exists() or record is None:
        table = load(data, "still" if path.suffix != "" else None)
        return lambda channel: of_table(table, channel, rate_hz)
    measured = Measured.named(record, data)
    if record.columns(measured.run.run)[0]:
        table = measured.table()
        return lambda channel: of_table(table, channel, rate_hz)
    return lambda channel: of_run(measured, channel, rate_hz)


def _of_array(path: Path, rate_hz: float | None) -> Stream:
    if rate_hz is None:
        raise DataError(f"{path}: an array does not say how fast it was sampled; give --rate HZ")
    try:
        with warnings.catch_warnings(action="ignore"):  # of a header as Python 2 wrote it
            array = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # its header is parsed as Python, which fails in many ways
        raise DataError(f"{path}: is no array that numpy.save wrote: {error}") from None
    if array.ndim == 2 and 1 in array.shape:
        array = array.reshape(-1)
    if array.ndim != 1:
        raise DataError(f"{path}: holds an array of shape {array.shape}; save one channel, of shape (n,)")
    return Stream(str(path), "values", rate_hz, "count", (array[i : i + BLOCK] for i in range(0, len(array), BLOCK)))
