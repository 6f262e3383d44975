"""The loop of model and measurement, the same for every kind of data: compare, diagnose, discover, add."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar, cast, overload

from threadpoolctl import threadpool_limits

from calibrations.discovery.dataset import Dataset
from calibrations.discovery.results import Comparison, Diagnosis, Discovery
from calibrations.discovery.rows import Rows
from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit
from calibrations.model import Model
from calibrations.table import Table

if TYPE_CHECKING:
    from calibrations.discovery.enough import Enough
    from calibrations.noise.dataset import StillRecord
    from calibrations.noise.fit import NoiseFit
    from calibrations.noise.record import Still

Effects = Mapping[str, Effect]
Call = TypeVar("Call", bound=Callable[..., Any])


def one_thread(call: Call) -> Call:
    """The function with one thread of linear algebra: several wait for each other on matrices of this size."""
    return cast(Call, threadpool_limits.wrap(limits=1, user_api="blas")(call))


@overload
def dataset(data: Table) -> Rows: ...
@overload
def dataset(data: Still) -> StillRecord: ...
def dataset(data: Table | Still) -> Dataset[Any]:
    """The data as the loop sees them."""
    if isinstance(data, Table):
        return Rows(data)
    from calibrations.noise.dataset import StillRecord  # a table needs no noise engine

    return StillRecord(data)


@overload
def compare(data: Table, model: Model) -> Comparison[Fit]: ...
@overload
def compare(data: Still, model: Model) -> Comparison[NoiseFit]: ...
@one_thread
def compare(data: Table | Still, model: Model) -> Comparison[Any]:
    """The model, fitted first if it has no values yet. Raises the errors of `fit`."""
    return dataset(data).compare(model, catalogue())


@overload
def diagnose(data: Table, model: Model, effects: Effects | None = None) -> Diagnosis[Fit]: ...
@overload
def diagnose(data: Still, model: Model, effects: Effects | None = None) -> Diagnosis[NoiseFit]: ...
@one_thread
def diagnose(data: Table | Still, model: Model, effects: Effects | None = None) -> Diagnosis[Any]:
    """The effects that `model` misses on the data. Raises the errors of `fit`."""
    return dataset(data).diagnose(model, catalogue() if effects is None else effects)


@overload
def discover(
    data: Table,
    model: Model,
    effects: Effects | None = None,
    without: Sequence[str] = (),
    enough: Enough | None = None,
) -> Discovery[Fit]: ...
@overload
def discover(
    data: Still,
    model: Model,
    effects: Effects | None = None,
    without: Sequence[str] = (),
    enough: Enough | None = None,
) -> Discovery[NoiseFit]: ...
@one_thread
def discover(
    data: Table | Still,
    model: Model,
    effects: Effects | None = None,
    without: Sequence[str] = (),
    enough: Enough | None = None,
) -> Discovery[Any]:
    """`model` with all effects that it misses on the data. Raises what `fit` raises.

    without   places of the signal chain, such as own-response, that the search leaves out
    enough    an error on unseen data at which the search stops
    """
    return dataset(data).without(without).discover(model, catalogue() if effects is None else effects, enough)


@overload
def add(effect: Effect, model: Model, data: Table, effects: Effects | None = None) -> Discovery[Fit]: ...
@overload
def add(effect: Effect, model: Model, data: Still, effects: Effects | None = None) -> Discovery[NoiseFit]: ...
@one_thread
def add(effect: Effect, model: Model, data: Table | Still, effects: Effects | None = None) -> Discovery[Any]:
    """`model` with one effect more, both fitted to the data. Raises ModelError, and what `fit` raises."""
    return dataset(data).add(effect, model, catalogue() if effects is None else effects)
