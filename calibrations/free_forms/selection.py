"""Which components act: forward selection with backward elimination and exchange on the restricted likelihood."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from calibrations.free_forms.components import Component
from calibrations.free_forms.reml import Gram, Sizes, estimate, gains, loss, without

ENTER = 16.0  # gain in -2 log restricted likelihood for one component more: 1 % of clean sensors (`chance`)
LEAVE = 12.0
SAME_PLACE = 6.0  # less for a component at a place that acts already: it is another form of one mechanism
MOST_COMPONENTS = 24
SPILL = 0.03  # of the remaining misfit: a place of less gain absorbs a part of another place
CANCELS = 1.5  # of the squares of the first misfit: other components cancel a larger component


def acting_places(names: Iterable[str], by_name: Mapping[str, Component]) -> set[str]:
    """Places of active components."""
    return {by_name[name].place for name in names if name in by_name}


def price(component: Component, acting_at: Collection[str]) -> float:
    """Least gain of a component beyond ENTER, given the acting places; it is smaller at one of these.

    A general component, which can follow almost anything, does not count as another form of the same mechanism.
    """
    return component.price - (SAME_PLACE if component.place in acting_at and not component.general else 0.0)


def prices(components: Iterable[Component]) -> float:
    """Sum of the prices of components, each given those before it."""
    total, acting_at = 0.0, set[str]()
    for component in components:
        total += price(component, acting_at)
        acting_at.add(component.place)
    return total


Pools = Sequence[Mapping[str, Component]]


def pools_of(components: Sequence[Component], catalogue_first: bool) -> Pools:
    """Pools of components in the order of trials: the next pool follows when no component of a pool gains."""
    simple = {c.name: c for c in components if not c.general}
    with_cause = {c.name: c for c in simple.values() if c.cause}
    all_components = {c.name: c for c in components}
    return [with_cause, simple, all_components] if catalogue_first else [simple, all_components]


def select(
    g: Gram,
    sizes: Sizes,
    components: Sequence[Component],
    pools: Pools,
    most: Mapping[str, float],
    limit: float,
    last: bool,
) -> Sizes:
    """Components added, exchanged and removed until nothing gains more than `limit`."""
    by_name = {c.name: c for c in components}
    visited: set[frozenset[str]] = set()
    sizes = _prune(g, sizes, by_name, most)
    stale: list[dict[str, float]] = [{} for _ in pools]
    pools = [dict(pool) for pool in pools]
    while len(sizes.variances) < MOST_COMPONENTS:
        best = _next(g, sizes, pools, stale, max(limit, SPILL * (sizes.deviance - g.rows)))
        if best is not None:
            larger = estimate(g, {**sizes.variances, best[0]: best[2]}, most, 12)
            if _cancelled(g, larger) - _cancelled(g, sizes):
                pools = [{name: c for name, c in pool.items() if name != best[0]} for pool in pools]
                continue
            sizes = larger
            if by_name[best[0]].reshaped is not None:
                break  # its shape is found first: its misfit looks like other places
            sizes = _prune(g, sizes, by_name, most)
            if frozenset(sizes.variances) not in visited:
                visited.add(frozenset(sizes.variances))
                continue
        if not last:
            break
        exchanged = _exchange(g, sizes, by_name, most)
        if set(exchanged.variances) == set(sizes.variances) or frozenset(exchanged.variances) in visited:
            break
        visited.add(frozenset(exchanged.variances))
        sizes = _prune(g, exchanged, by_name, most)
    return estimate(g, sizes.variances, most)


def _cancelled(g: Gram, sizes: Sizes) -> set[str]:
    """The components that are far larger than the signal, so that others cancel them."""
    start, names = 0, set()
    for name in sizes.variances:
        block = g.blocks[name]
        u = sizes.coefficients[start : start + block.stop - block.start]
        start += len(u)
        if float(u @ g.products[block, block] @ u) > CANCELS * g.squares:
            names.add(name)
    return names


def _next(
    g: Gram, sizes: Sizes, pools: Pools, stale: Sequence[dict[str, float]], threshold: float
) -> tuple[str, float, float] | None:
    """The first component, by pool, whose gain is above the threshold; None if there is none."""
    for pool, known_gains in zip(pools, stale, strict=True):
        best = _best(g, sizes, pool, known_gains)
        if known_gains and (best is None or best[1] <= threshold):
            known_gains.clear()
            best = _best(g, sizes, pool, known_gains)
        if best is not None and best[1] > threshold:
            return best
    return None


def _best(
    g: Gram, sizes: Sizes, by_name: Mapping[str, Component], stale: dict[str, float] | None = None
) -> tuple[str, float, float] | None:
    """The component of largest gain minus price, with this value and its variance.

    Gains mostly fall when components are added. With `stale` gains of an earlier call the function computes the most
    promising first, and stops when no other one promises more.
    """
    families = {by_name[name].family for name in sizes.variances if name in by_name} - {""}
    names = [n for n, c in by_name.items() if n not in sizes.variances and c.family not in families and n in g.blocks]
    known_gains = {} if stale is None else stale
    names.sort(key=lambda n: -known_gains.get(n, np.inf))
    acting_at = acting_places(sizes.variances, by_name)
    best: tuple[str, float, float] | None = None
    for part in [names[k : k + 6] for k in range(0, len(names), 6)] if known_gains else [names]:
        if not part or (best is not None and best[1] > known_gains.get(part[0], np.inf)):
            break
        for n, (gained, variance) in gains(g, sizes, part).items():
            known_gains[n] = gained - price(by_name[n], acting_at)
            if best is None or known_gains[n] > best[1]:
                best = n, known_gains[n], variance
    return best


def _prune(g: Gram, sizes: Sizes, by_name: Mapping[str, Component], most: Mapping[str, float]) -> Sizes:
    """The sizes without components whose removal costs less than their price, those of least cost first."""
    while True:
        prices_by_name = {n: price(c, acting_places(sizes.variances.keys() - {n}, by_name)) for n, c in by_name.items()}
        costs = {n: loss(g, sizes, n) - prices_by_name[n] for n in sizes.variances if not by_name[n].noise}
        if not costs:
            return sizes
        name = min(costs, key=lambda n: costs[n])
        if costs[name] > LEAVE:
            return sizes
        remaining = {k: v for k, v in sizes.variances.items() if k != name}
        reduced = estimate(g, remaining, most, 12)
        if reduced.deviance - sizes.deviance - prices_by_name[name] > LEAVE:
            return sizes
        sizes = reduced


def _exchange(g: Gram, sizes: Sizes, by_name: Mapping[str, Component], most: Mapping[str, float]) -> Sizes:
    """The sizes with each component replaced by a likelier one, if there is one."""
    for name in [n for n in sizes.variances if not by_name[n].noise]:
        if name not in sizes.variances:
            continue
        reduced = without(g, sizes, name)
        acting_at = acting_places(reduced.variances, by_name)
        component_price = price(by_name[name], acting_at)
        replacement = estimate(g, reduced.variances, most, 12, sizes.deviance + component_price + LEAVE)
        if replacement.deviance - sizes.deviance - component_price <= LEAVE:  # the others take its part
            sizes = replacement
            continue
        loss_of_component = reduced.deviance - sizes.deviance - component_price
        best = _best(g, reduced, by_name)
        if best is None or best[0] == name or best[1] < loss_of_component + 1.0:
            continue
        exchanged = estimate(g, {**reduced.variances, best[0]: best[2]}, most, 12)
        if _cancelled(g, exchanged) - _cancelled(g, sizes):
            continue
        improvement = sizes.deviance + component_price - exchanged.deviance - price(by_name[best[0]], acting_at)
        if improvement > 1.0:
            sizes = exchanged
    return sizes
