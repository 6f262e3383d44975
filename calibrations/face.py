"""The functions of `import calibrations as cal`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from calibrations.compensation.inverse import invert_model
from calibrations.discovery.results import Comparison, Diagnosis, Discovery
from calibrations.errors import DataError
from calibrations.fit import Fit
from calibrations.fit import fit as fitted
from calibrations.importing.foreign import read_csv
from calibrations.loop import compare as compared
from calibrations.loop import diagnose as diagnosed
from calibrations.loop import discover as discovered
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.table import Array, Constant, Table

GivenModel = Model | str | Path  # a model, the name of a shipped one, or a model file


class Columns(Protocol):
    """Columns by name: a pandas.DataFrame, or a mapping."""

    def items(self) -> Iterable[tuple[str, Iterable[float]]]:
        """(name, column) pairs."""


def read(path: Path | str, kind: str | None = None) -> Table:
    """The table in a data file. Raises DataError naming file, line and column."""
    return read_csv(path, kind)


def table(columns: Columns, kind: str, constants: Mapping[str, Constant] | None = None) -> Table:
    """A table of `kind` (poses, positions, motion, rates) from columns in the units of data files. Raises DataError."""
    return Table.from_columns(kind, dict(columns.items()), constants, "the given columns")


def fit(data: Table, model: GivenModel) -> Fit:
    """`model` with its parameters estimated from `data`."""
    return fitted(_model(model), data)


def compare(data: Table, model: GivenModel) -> Comparison[Fit]:
    """`model` beside `data`, and where it fails."""
    return compared(data, _model(model))


def diagnose(data: Table, model: GivenModel) -> Diagnosis[Fit]:
    """Which physical effect `model` misses on `data`."""
    return diagnosed(data, _model(model))


def discover(data: Table, model: GivenModel) -> Discovery[Fit]:
    """`model` with the effects that it misses on `data`, added one by one."""
    return discovered(data, _model(model))


def compensate(model: GivenModel, outputs: Array, **columns: Array) -> Array:
    """The specific force along the reference axes, g, shape (n, axes), from outputs of the model's axes, (n, axes).

    `columns` are what the model follows beside the outputs, shape (n,): temperature_c, supply_v, t_s. Samples are taken
    independently of each other. Raises ModelError where the model has no values or cannot be inverted.
    """
    made = invert_model(_model(model))
    values = np.atleast_2d(np.asarray(outputs, dtype=float))
    if made.program.remembered:
        raise DataError(f"{made.model.name}: remembers earlier samples; use `rig compensate` for a product's source")
    if values.shape[1] != len(made.forward.axes):
        raise DataError(f"outputs have shape {values.shape}; the model has the axes {', '.join(made.forward.axes)}")
    given = {**dict(zip((f"v{axis}" for axis in made.forward.axes), values.T, strict=True)), **columns}
    if missing := [name for name in made.program.inputs if name not in given]:
        raise DataError(f"{made.model.name}: needs {', '.join(missing)}, as in {missing[0]}=array")
    found = made.program.run(given)
    return np.column_stack([found[name] for name in made.program.sought])


def _model(model: GivenModel) -> Model:
    return model if isinstance(model, Model) else read_model(model)
