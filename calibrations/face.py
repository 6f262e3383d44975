"""The functions of `import calibrations as cal`. Each imports what it needs when it is called: the import is quick."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from calibrations.errors import DataError
from calibrations.table import AXES, Array, Constant, Table
from calibrations.tables import KINDS

if TYPE_CHECKING:
    from calibrations.discovery.results import Comparison, Diagnosis, Discovery
    from calibrations.fitting.fit import Fit
    from calibrations.model import Model
    from calibrations.noise.analysis import NoiseAnalysis
    from calibrations.noise.record import Samples

    GivenModel = Model | str | Path  # a model, the name of a shipped one, or a model file

MOST_UNEVEN = 0.5  # of a step, by which steps of time may differ
NOT_CHANNELS = ("t_s", "temperature_c", "supply_v")
AXIS_OF = {name: axis for kind in KINDS.values() for name, axis in zip(kind.outputs, AXES, strict=False)} | {"v": "x"}


class Columns(Protocol):
    """Columns by name: a pandas.DataFrame, or a mapping."""

    def items(self) -> Iterable[tuple[str, Iterable[float]]]:
        """(name, column) pairs."""


def read(path: Path | str, kind: str | None = None, topic: str | None = None) -> Table:
    """The table in a data file: CSV, JSON, HDF5, MATLAB, NumPy, Parquet, Excel, ULog, DataFlash, ROS bags; `topic`
    names the group, worksheet or topic of a file that has several. Raises DataError naming file, line and column.
    """
    from calibrations.importing.foreign import read_csv

    return read_csv(path, kind, topic)


def table(columns: Columns, kind: str, constants: Mapping[str, Constant] | None = None) -> Table:
    """A table of `kind` (poses, positions, motion, rates) from columns in the units of data files. Raises DataError."""
    return Table.from_columns(kind, dict(columns.items()), constants, "the given columns")


def fit(data: Table, model: GivenModel) -> Fit:
    """`model` with its parameters estimated from `data`."""
    from calibrations.fitting.fit import fit as fitted

    return fitted(_model(model), data)


def compare(data: Table, model: GivenModel) -> Comparison[Fit]:
    """`model` beside `data`, and where it fails."""
    from calibrations.loop import compare as compared

    return compared(data, _model(model))


def diagnose(data: Table, model: GivenModel) -> Diagnosis[Fit]:
    """Which physical effect `model` misses on `data`."""
    from calibrations.loop import diagnose as diagnosed

    return diagnosed(data, _model(model))


def discover(data: Table, model: GivenModel, without: Sequence[str] = (), enough: str = "") -> Discovery[Fit]:
    """`model` with the effects that it misses on `data`, added one by one. Raises ModelError.

    without   places of the signal chain, such as "own-response", that the search leaves out
    enough    an error on unseen data at which the search stops, such as "0.5mg", "2mV" or "1.5floors"
    """
    from calibrations.discovery.enough import parse_enough
    from calibrations.loop import discover as discovered

    return discovered(data, _model(model), without=without, enough=parse_enough(enough) if enough else None)


def noise(data: Table | Array, rate_hz: float | None = None) -> NoiseAnalysis:
    """Allan deviation and noise coefficients of samples at an even rate: an array (n,), or a table of kind still.

    A table's columns but time, temperature and supply are its channels. `rate_hz` is needed where neither t_s nor
    sample_rate_hz gives it. Raises DataError for uneven times, which `rig noise` can close.
    """
    from calibrations.noise.analysis import analyse
    from calibrations.noise.record import reduce_record

    given = data if isinstance(data, Table) else Table.from_columns("still", {"v": data}, None, "the given samples")
    return analyse(reduce_record(_channels(given, rate_hz), given.source, given.constants, every_deviation=True))


def compensate(model: GivenModel, outputs: Array, **columns: Array) -> Array:
    """The specific force along the reference axes, g, shape (n, axes), from outputs of the model's axes, (n, axes).

    `columns` are what the model follows beside the outputs, shape (n,): temperature_c, supply_v, t_s. Samples are taken
    independently of each other. Raises ModelError where the model has no values or cannot be inverted.
    """
    from calibrations.compensation.inverse import invert_model

    made = invert_model(_model(model))
    values = np.atleast_2d(np.asarray(outputs, dtype=float))
    if made.program.remembered:
        raise DataError(
            f"{made.model.name}: has hysteresis, so its inverse needs earlier samples; use `rig compensate`"
        )
    if values.shape[1] != len(made.forward.axes):
        raise DataError(f"outputs have shape {values.shape}; the model has the axes {', '.join(made.forward.axes)}")
    given = {**dict(zip((f"v{axis}" for axis in made.forward.axes), values.T, strict=True)), **columns}
    if missing := [name for name in made.program.inputs if name not in given]:
        raise DataError(f"{made.model.name}: needs {', '.join(missing)}, as in {missing[0]}=array")
    found = made.program.run(given)
    return np.column_stack([found[name] for name in made.program.sought])


def _model(model: GivenModel) -> Model:
    from calibrations.model.file import read_model

    return read_model(model) if isinstance(model, (str, Path)) else model


def _channels(table: Table, rate_hz: float | None) -> Iterator[Samples]:
    """The channels of a still table. Raises DataError where its rate is unknown, or its times are uneven."""
    from calibrations.noise.record import Samples

    rate_hz = rate_hz or table.number("sample_rate_hz", 0.0)
    if not rate_hz:
        if "t_s" not in table:
            raise DataError(f"{table.source}: its rate is not known; give rate_hz, as in cal.noise(data, rate_hz=100)")
        steps_s = np.diff(table.time_s)
        rate_hz = 1 / float(np.median(steps_s))
        if np.ptp(steps_s) * rate_hz > MOST_UNEVEN:
            raise DataError(f"{table.source}: t_s is uneven; `rig noise` can close gaps")
    corner_hz = table.number("filter_corner_hz", np.inf)
    for name in (name for name in table.columns if name not in NOT_CHANNELS):
        unit = "V" if name.endswith("_v") else str(table.constants.get("unit", "count"))
        yield Samples(AXIS_OF.get(name, name), [table.column(name)], rate_hz, unit, corner_hz, name=name)
