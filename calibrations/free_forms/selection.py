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
SPILL = 0.03  # of the misfit that is left: a place that gains less takes up part of what acts elsewhere
CANCELS = 1.5  # of the squares of the first misfit: more in one component is taken off by others


def acting_places(names: Iterable[str], by_name: Mapping[str, Component]) -> set[str]:
    """Places of active components."""
    return {by_name[name].place for name in names if name in by_name}


def price(component: Component, acting: Collection[str]) -> float:
    """What a component must gain more than another beside the places that act; less at one of them.

    A component that can follow almost anything is no other form of what acts there.
    """
    return component.price - (SAME_PLACE if component.place in acting and not component.general else 0.0)


def prices(components: Iterable[Component]) -> float:
    """What components must gain more, each beside those before it."""
    total, acting = 0.0, set[str]()
    for component in components:
        total += price(component, acting)
        acting.add(component.place)
    return total


Pools = Sequence[Mapping[str, Component]]


def pools_of(components: Sequence[Component], catalogue_first: bool) -> Pools:
    """Components in the order in which they are tried: the next pool once none of one gains."""
    simple = {c.name: c for c in components if not c.general}
    named = {c.name: c for c in simple.values() if c.cause}
    every = {c.name: c for c in components}
    return [named, simple, every] if catalogue_first else [simple, every]


def select(
    g: Gram,
    sizes: Sizes,
    components: Sequence[Component],
    pools: Pools,
    most: Mapping[str, float],
    limit: float,
    last: bool,
) -> tuple[Sizes, list[str]]:
    """Components added, exchanged and removed until nothing gains more than `limit`."""
    by_name = {c.name: c for c in components}
    steps: list[str] = []
    seen: set[frozenset[str]] = set()
    sizes = _pruned(g, sizes, by_name, most, steps)
    stale: list[dict[str, float]] = [{} for _ in pools]
    pools = [dict(pool) for pool in pools]
    while len(sizes.variances) < MOST_COMPONENTS:
        best = _next(g, sizes, pools, stale, max(limit, SPILL * (sizes.deviance - g.rows)))
        if best is not None:
            larger = estimate(g, {**sizes.variances, best[0]: best[2]}, most, 12)
            if _cancels(g, larger):
                pools = [{name: c for name, c in pool.items() if name != best[0]} for pool in pools]
                continue
            sizes = larger
            steps.append(f"+{best[0]}")
            if by_name[best[0]].reshaped is not None:
                break  # its shape is found first: its misfit looks like other places
            sizes = _pruned(g, sizes, by_name, most, steps)
            if frozenset(sizes.variances) not in seen:
                seen.add(frozenset(sizes.variances))
                continue
        if not last:
            break
        after = _exchanged(g, sizes, by_name, most, steps)
        if set(after.variances) == set(sizes.variances) or frozenset(after.variances) in seen:
            break
        seen.add(frozenset(after.variances))
        sizes = _pruned(g, after, by_name, most, steps)
    return estimate(g, sizes.variances, most), steps


def _cancels(g: Gram, sizes: Sizes) -> bool:
    """Whether a component adds far more than there is to explain, so that another one takes it off again."""
    at = 0
    for name in sizes.variances:
        block = g.blocks[name]
        u = sizes.coefficients[at : at + block.stop - block.start]
        at += len(u)
        if float(u @ g.products[block, block] @ u) > CANCELS * g.squares:
            return True
    return False


def _next(
    g: Gram, sizes: Sizes, pools: Pools, stale: Sequence[dict[str, float]], enough: float
) -> tuple[str, float, float] | None:
    """The component of the first pool that gains enough; None where none does."""
    for pool, known in zip(pools, stale, strict=True):
        best = _best(g, sizes, pool, known)
        if known and (best is None or best[1] <= enough):
            known.clear()
            best = _best(g, sizes, pool, known)
        if best is not None and best[1] > enough:
            return best
    return None


def _best(
    g: Gram, sizes: Sizes, by_name: Mapping[str, Component], stale: dict[str, float] | None = None
) -> tuple[str, float, float] | None:
    """The component that gains most, price taken off, and its variance.

    Gains mostly fall when components are added: with `stale` gains of an earlier call the most promising are computed
    first, until none of the others promises more.
    """
    taken = {by_name[name].family for name in sizes.variances if name in by_name} - {""}
    names = [n for n, c in by_name.items() if n not in sizes.variances and c.family not in taken and n in g.blocks]
    known = {} if stale is None else stale
    names.sort(key=lambda n: -known.get(n, np.inf))
    acting = acting_places(sizes.variances, by_name)
    best: tuple[str, float, float] | None = None
    for part in [names[k : k + 6] for k in range(0, len(names), 6)] if known else [names]:
        if not part or (best is not None and best[1] > known.get(part[0], np.inf)):
            break
        for n, (gained, variance) in gains(g, sizes, part).items():
            known[n] = gained - price(by_name[n], acting)
            if best is None or known[n] > best[1]:
                best = n, known[n], variance
    return best


def _pruned(
    g: Gram, sizes: Sizes, by_name: Mapping[str, Component], most: Mapping[str, float], steps: list[str]
) -> Sizes:
    """Without components whose loss costs less than they must gain, the least first."""
    while True:
        each = {n: price(c, acting_places(sizes.variances.keys() - {n}, by_name)) for n, c in by_name.items()}
        costs = {n: loss(g, sizes, n) - each[n] for n in sizes.variances if not by_name[n].noise}
        if not costs:
            return sizes
        name = min(costs, key=lambda n: costs[n])
        if costs[name] > LEAVE:
            return sizes
        rest = {k: v for k, v in sizes.variances.items() if k != name}
        after = estimate(g, rest, most, 12)
        if after.deviance - sizes.deviance - each[name] > LEAVE:
            return sizes
        steps.append(f"-{name}")
        sizes = after


def _exchanged(
    g: Gram, sizes: Sizes, by_name: Mapping[str, Component], most: Mapping[str, float], steps: list[str]
) -> Sizes:
    """With each component replaced where another one in its stead is likelier."""
    for name in [n for n in sizes.variances if not by_name[n].noise]:
        if name not in sizes.variances:
            continue
        others = without(g, sizes, name)
        beside = acting_places(others.variances, by_name)
        own = price(by_name[name], beside)
        alone = estimate(g, others.variances, most, 12, sizes.deviance + own + LEAVE)
        if alone.deviance - sizes.deviance - own <= LEAVE:  # the others take its part
            steps.append(f"-{name}")
            sizes = alone
            continue
        lost = others.deviance - sizes.deviance - own
        best = _best(g, others, by_name)
        if best is None or best[0] == name or best[1] < lost + 1.0:
            continue
        tried = estimate(g, {**others.variances, best[0]: best[2]}, most, 12)
        if _cancels(g, tried):
            continue
        better = sizes.deviance + own - tried.deviance - price(by_name[best[0]], beside)
        if better > 1.0:
            steps.append(f"{name}>{best[0]}")
            sizes = tried
    return sizes
