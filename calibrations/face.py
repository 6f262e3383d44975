"""The functions of `import calibrations as cal`. Each loads its modules when it is called, so the import is quick."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from calibrations.errors import DataError, ModelError
from calibrations.frames import columns_by_name
from calibrations.result import Presentation, Result
from calibrations.table import AXES, Array, Constant, Table
from calibrations.tables import KINDS

if TYPE_CHECKING:
    from calibrations.discovery.results import Comparison, Diagnosis, Discovery
    from calibrations.effects import Effect
    from calibrations.fitting.fit import Fit
    from calibrations.model import Model
    from calibrations.noise.analysis import NoiseAnalysis
    from calibrations.noise.record import Samples

    GivenModel = Model | Fit | Discovery[Fit] | str | Path  # a name is that of a shipped model; a path, a model file
    GivenEffect = Effect | type[Effect] | str | Path  # a name is that of an effect of the catalogue; a path, its file

MOST_UNEVEN = 0.5  # of a step, by which steps of time may differ
CONDITIONS = ("t_s", "temperature_c", "supply_v")
AXIS_OF = {name: axis for kind in KINDS.values() for name, axis in zip(kind.outputs, AXES, strict=False)} | {"v": "x"}


class Columns(Protocol):
    """Columns by name: a pandas.DataFrame, or a mapping."""

    def items(self) -> Iterable[tuple[str, Iterable[float]]]:
        """(name, column) pairs."""


def read(path: Path | str, kind: str | None = None, topic: str | None = None) -> Table:
    """The table in a data file: CSV, JSON, HDF5, MATLAB, NumPy, Parquet, Excel, ULog, DataFlash, ROS bags; `topic`
    names the group, worksheet or topic of a file that has several. The rows of a raw log are averaged over its dwells
    or still intervals, as `rig.load` does it; copied rows count once, and the clock continues where it starts again,
    with a warning. Raises DataError naming file, line and column.
    """
    from calibrations.importing.foreign import read_csv, sort_out_rows
    from calibrations.importing.raw_logs import average_raw_log

    found, remarks = sort_out_rows(average_raw_log(read_csv(path, kind, topic)))
    for remark in remarks:
        warnings.warn(remark, stacklevel=3)
    return found


def table(columns: Columns, kind: str, constants: Mapping[str, Constant] | None = None) -> Table:
    """A table of `kind` (poses, positions, motion, rates) from columns in the units of data files.

    The rows of a raw log are averaged, as `read` does it. Raises DataError.
    """
    from calibrations.importing.raw_logs import average_raw_log

    if not callable(getattr(columns, "items", None)):
        raise DataError(
            f"cal.table: columns with names are needed, not a {type(columns).__name__}; give a data frame or "
            'a mapping, such as {"ax": a[:, 0], "ay": a[:, 1], "az": a[:, 2]}'
        )
    return average_raw_log(Table.from_columns(kind, dict(columns.items()), constants, "the given columns"))


def fit(data: Table, model: GivenModel) -> Fit:
    """`model` with its parameters estimated from `data`."""
    from calibrations.fitting.fit import fit as fitted

    return fitted(_model(model), _data(data))


def compare(data: Table, model: GivenModel) -> Comparison[Fit]:
    """The error of `model` on `data`, and the places where it fails."""
    from calibrations.loop import compare as compared

    return compared(_data(data), _model(model))


def diagnose(data: Table, model: GivenModel, effects: Iterable[GivenEffect] = ()) -> Diagnosis[Fit]:
    """The physical effects that `model` misses on `data`. Your own `effects` are tried in addition to the catalogue."""
    from calibrations.effects.catalogue import with_own
    from calibrations.loop import diagnose as diagnosed

    return diagnosed(_data(data), _model(model), with_own(effects))


def discover(
    data: Table,
    model: GivenModel,
    without: Sequence[str] = (),
    enough: str = "",
    effects: Iterable[GivenEffect] = (),
) -> Discovery[Fit]:
    """`model` with the effects that it misses on `data`, added one by one. Raises ModelError.

    without   places of the signal chain, such as "own-response", that the search leaves out
    enough    an error on unseen data at which the search stops, such as "0.5mg", "2mV" or "1.5floors"
    effects   your own, in addition to the catalogue: classes, or their files
    """
    from calibrations.discovery.enough import parse_enough
    from calibrations.effects.catalogue import with_own
    from calibrations.loop import discover as discovered

    stop = parse_enough(enough) if enough else None
    return discovered(_data(data), _model(model), with_own(effects), without, stop)


def add(model: GivenModel, effect: GivenEffect) -> Model:
    """`model` with one effect more, which `fit` then estimates. Raises ModelError where the model has it already.

    `effect` is the name of one of the catalogue, the file of one of your own, a class that derives from `Effect`, or a
    curve of unknown form at a place of the signal chain, such as `free:own-response`.
    """
    from calibrations.effects.catalogue import load_effect
    from calibrations.free_forms.place_names import PREFIX
    from calibrations.free_forms.requested import resolve_effect

    base = _model(model)
    if isinstance(effect, str) and effect.startswith(PREFIX):
        new_effect = resolve_effect(effect, {})
    else:
        new_effect = load_effect(effect)
    if base.holds(new_effect.name):
        raise ModelError(f"{base.name}: {new_effect.name} is already in the model; it has {', '.join(base.effects)}")
    return base.with_effect(new_effect)


def noise(data: Table | Columns | Array, rate_hz: float | None = None) -> NoiseAnalysis:
    """Allan deviation and noise coefficients of samples at an even rate.

    `data` is an array (n,), or (n, axes) with the axes x, y, z; or a table of kind still, a mapping or a
    pandas.DataFrame, whose columns but time, temperature and supply are the channels. `rate_hz` is needed where
    neither t_s nor sample_rate_hz gives it. Raises DataError for uneven times, which `rig noise` can close.
    """
    from calibrations.noise.analysis import analyse
    from calibrations.noise.record import reduce_record

    table = data if isinstance(data, Table) else _make_still(data)
    return analyse(reduce_record(_channels(table, rate_hz), table.source, table.constants, every_deviation=True))


def compensate(model: GivenModel, outputs: Table | Columns | Array, **columns: float | Array) -> Any:
    """The specific force along the reference axes in g, shape (n, axes), from outputs of the model's axes.

    `model` may be a fit or a discovery. `outputs` is an array (n, axes), in the order of the model's axes; or a table,
    a mapping or a pandas.DataFrame with the columns of data files (vx_v or ax, and so on). A data frame gives a data
    frame with its index. A gyroscope's model gives deg/s, a magnetometer's the field as a share of its strength.

    `columns` are what the model follows beside the outputs, where the data do not have it: temperature_c, supply_v,
    t_s; shape (n,), or one number. Samples are taken independently of each other. Raises ModelError where the model has
    no values or cannot be inverted, DataError where the outputs do not fit the model.
    """
    from calibrations.compensation.samples import compensate as compensated

    return compensated(_model(model), outputs, columns)


def _presentation_of(result: Result) -> Presentation:
    """The forms of a result. They load when it is shown."""
    from calibrations.presentation.results import presentation_of

    return presentation_of(result)


Result.register_presentation(_presentation_of)


def _data(data: Any) -> Table:
    """The table itself. Raises DataError for anything else: it would end in an error of the analysis."""
    if isinstance(data, Table):
        return data
    hint = "cal.read(path)" if isinstance(data, (str, Path)) else 'cal.table(data, kind="poses")'
    raise DataError(f"a table is needed, not a {type(data).__name__}; make one with {hint}")


def _model(source: GivenModel) -> Model:
    """The model that is given by its name or file, or that a fit or a discovery has. Raises ModelError, UnknownName."""
    from calibrations.model import Model
    from calibrations.model.file import read_model

    if isinstance(source, (str, Path)):
        return read_model(source)
    model = source if isinstance(source, Model) else getattr(source, "model", None)
    if isinstance(model, Model):
        return model
    hint = "; its fit is in its member `fit`" if isinstance(getattr(source, "fit", None), Result) else ""
    raise ModelError(
        f"a model is needed, not a {type(source).__name__}; give the name of a model, its file, a model, a "
        f"fit or a discovery{hint}"
    )


def _make_still(data: Any) -> Table:
    """The still table of samples by name, or of an array. Raises DataError for an array of another shape."""
    source = "the given samples"
    columns = columns_by_name(data)
    if columns is None and np.ndim(data) == 2:
        samples = np.asarray(data)
        if samples.shape[1] > len(AXES):
            hint = "exchange rows and columns, as in data.T" if len(samples) <= len(AXES) else "name the columns"
            raise DataError(f"{source}: their shape is {samples.shape}; (n,) or (n, axes) is needed: {hint}")
        columns = dict(zip(AXES, samples.T, strict=False))
    return Table.from_columns("still", {"v": data} if columns is None else columns, None, source)


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
    for name in (name for name in table.columns if name not in CONDITIONS):
        unit = "V" if name.endswith("_v") else str(table.constants.get("unit", "count"))
        yield Samples(AXIS_OF.get(name, name), [table.column(name)], rate_hz, unit, corner_hz, name=name)
