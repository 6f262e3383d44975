"""The inverse of a model on samples in memory: an array, columns by name, a data frame, or a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from calibrations.compensation.inverse import Compensation, invert_model
from calibrations.errors import DataError, MissingColumn, nearest
from calibrations.frames import columns_by_name, data_frame
from calibrations.model import Model
from calibrations.table import AXES, Array, Table
from calibrations.tables import KINDS

NAMES = {"g": "a{}_g", "field": "m{}", "deg/s": "g{}_deg_s"}  # columns of the sensed quantity, by its unit


def compensate(model: Model, samples: Any, columns: Mapping[str, Any]) -> Any:
    """The sensed quantity, from `samples` and further `columns`: an array (n, axes), or a data frame for one.

    Raises ModelError where the model has no values or cannot be inverted, DataError where the samples do not fit it.
    """
    compensation = invert_model(model)
    if compensation.program.remembered:
        raise DataError(f"{model.name}: has hysteresis, so its inverse needs earlier samples; use `rig compensate`")
    given = samples.columns if isinstance(samples, Table) else columns_by_name(samples)
    inputs = dict(columns)
    if given is None:
        outputs = _array(samples, compensation.forward.axes)
    else:
        outputs = _columns(given, compensation)
        inputs = {name: given[name] for name in compensation.program.inputs if name in given} | inputs
    result = compensation.program.run(_inputs(compensation, outputs, inputs))
    forces = np.column_stack([result[name] for name in compensation.program.unknowns])
    if not hasattr(samples, "iloc"):
        return forces
    names = [NAMES[compensation.unit].format(axis) for axis in compensation.forward.axes]
    return data_frame(forces, index=samples.index, columns=names)


def _array(samples: Any, axes: tuple[str, ...]) -> Array:
    """Outputs (n, axes). One sample may be (axes,), and samples of one axis (n,)."""
    outputs = _numbers(samples, "the outputs")
    if outputs.ndim == 1:
        outputs = outputs[:, None] if len(axes) == 1 else outputs[None, :]
    if outputs.ndim == 2 and outputs.shape[1] == len(axes):
        return outputs
    requirement = f"the model has the axes {', '.join(axes)}, so (n, {len(axes)}) is needed"
    hint = "give a column for each of these axes"
    if outputs.ndim == 2 and outputs.shape[0] == len(axes):
        hint = "exchange rows and columns, as in outputs.T"
    elif outputs.ndim == 2 and outputs.shape[1] == len(AXES):
        hint = f"select their columns, as in outputs[:, {[AXES.index(axis) for axis in axes]}]"
    raise DataError(f"the outputs have shape {np.shape(samples)}; {requirement}: {hint}")


def _columns(given: Mapping[str, Any], compensation: Compensation) -> Array:
    """Outputs (n, axes) from columns with the names of data files. Raises MissingColumn."""
    kinds = [kind for kind in KINDS.values() if kind.input_unit == compensation.unit]
    sets = list(dict.fromkeys(_outputs(kind.outputs, compensation.forward.axes) for kind in kinds))
    sets = [names for names in sets if len(names) == len(compensation.forward.axes)]
    for names in sets:
        if all(name in given for name in names):
            return np.column_stack([_numbers(given[name], f'the column "{name}"') for name in names])
    close = max(sets, key=lambda names: sum(name in given for name in names))
    missing = next(name for name in close if name not in given)
    axes = ", ".join(compensation.forward.axes)
    raise MissingColumn(
        f'the column "{missing}" is missing: the model has the axes {axes}; name the '
        f"columns of its outputs {' or '.join(map(', '.join, sets))}{nearest(missing, map(str, given))}"
    )


def _outputs(names: tuple[str, ...], axes: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name for axis, name in zip(AXES, names, strict=False) if axis in axes)


def _inputs(compensation: Compensation, outputs: Array, columns: Mapping[str, Any]) -> dict[str, Array]:
    """All inputs of the program, a value a row. Raises DataError for one that is missing or of another length."""
    if missing := [
        name for name in compensation.program.inputs[len(compensation.forward.axes) :] if name not in columns
    ]:
        raise DataError(
            f"{compensation.model.name}: needs {', '.join(missing)}; give an array with a value for each row, or one "
            f"number, as in {missing[0]}=..."
        )
    inputs = {f"v{axis}": values for axis, values in zip(compensation.forward.axes, outputs.T, strict=True)}
    for name, column in columns.items():
        values = _numbers(column, f'the column "{name}"')
        if values.shape not in ((), (len(outputs),)):
            raise DataError(
                f'the column "{name}" has shape {values.shape}, and there are {len(outputs)} rows of outputs; give one '
                "value for each row, or one number for all"
            )
        inputs[name] = np.broadcast_to(values, len(outputs))
    return inputs


def _numbers(values: Any, name: str) -> Array:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise DataError(f"{name}: not numbers, but {type(values).__name__}; give an array of numbers") from None
