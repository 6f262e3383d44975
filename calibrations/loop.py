"""The loop of model and measurement, the same for every kind of data: compare, diagnose, discover."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar, cast

from threadpoolctl import threadpool_limits

from calibrations.discovery.dataset import Dataset
from calibrations.discovery.results import Comparison, Diagnosis, Discovery
from calibrations.discovery.rows import Rows
from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue
from calibrations.model import Model
from calibrations.table import Table

if TYPE_CHECKING:
    from calibrations.discovery.enough import Enough
    from calibrations.noise.record import Still

Effects = Mapping[str, Effect]
Call = TypeVar("Call", bound=Callable[..., Any])


def one_thread(call: Call) -> Call:
    """The function with one thread of linear algebra: several wait for each other on matrices of this size."""
    return cast(Call, threadpool_limits.wrap(limits=1, user_api="blas")(call))


def dataset(data: Table | Still) -> Dataset[Any]:
    """The data as the loop sees them."""
    if isinstance(data, Table):
        return Rows(data)
    from calibrations.noise.dataset import StillRecord  # a table needs no noise engine

    return StillRecord(data)


@one_thread
def compare(data: Table | Still, model: Model) -> Comparison[Any]:
    """The model, fitted first if it has no values yet. Raises the errors of `fit`."""
    return dataset(data).compare(model, catalogue())


@one_thread
def diagnose(data: Table | Still, model: Model, effects: Effects | None = None) -> Diagnosis[Any]:
    """The effects that `model` misses on the data. Raises the errors of `fit`."""
    return dataset(data).diagnose(model, catalogue() if effects is None else effects)


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
