"""Forward selection with backward elimination and exchange on the restricted likelihood, around Gauss-Newton steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tests.benchmark.free_forms.chain import Component, State, Values, base_size, start, state_at
from tests.benchmark.free_forms.measurement import Array, Measurement
from tests.benchmark.free_forms.places import candidates, saw
from tests.benchmark.free_forms.reml import (
    Gram,
    Sizes,
    beside_base,
    coefficients,
    estimate,
    gain_of_columns,
    gains,
    gram,
    loss,
    whitened,
    without,
)

ENTER = 16.0  # gain in -2 log restricted likelihood for one component more: 1 % of clean sensors (`chance`)
LEAVE = 12.0
COARSE = (1e-3, 2e-5)  # of the misfit, at each linearisation: less may be a second-order remainder
ROUNDS = 7
MOST_COMPONENTS = 24
SPILL = 0.03  # of the misfit that is left: a place that gains less takes up part of what acts elsewhere
LARGEST = 4.0  # of the mean square of the first misfit: more is two components against each other
SLOW_MOST = 0.5  # slow noise, in noise floors, at most (rms)
SAW_POINTS = 3.0  # frequencies in a resolved interval
SAW_REJECTIONS = 1  # of one saw: its phase may belong to an output that is not right yet
SAW_VISIBLE = 2.0  # steps' frequency times the noise of a sample: beyond, nothing is left of a saw in a mean


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The end of the search."""

    data: Measurement
    white: Array
    components: Sequence[Component]
    gram: Gram
    columns: Array  # whitened [base, components, data]
    sizes: Sizes
    values: Values
    state: State
    path: Sequence[str]

    def component(self, name: str) -> Component:
        return next(c for c in self.components if c.name == name)

    @property
    def active(self) -> list[str]:
        return [name for name in self.sizes.variances if not self.component(name).noise]


def search(data: Measurement, white: Array) -> SearchResult:
    """Places that act, with their sizes. `white` (channels, n): standard deviation of each mean."""
    values = start(data)
    state = state_at(data, values, ())
    components = candidates(data, state)
    scales: dict[str, float] = {}
    noise = {c.name for c in components if c.noise}
    floor = float(np.sqrt(np.mean(white**2)))
    variances = dict.fromkeys(noise, (0.1 * floor) ** 2)
    most: dict[str, float] = dict.fromkeys(noise, (SLOW_MOST * floor) ** 2)
    path: list[str] = []
    b = base_size(data)
    rejected: list[float] = []
    first = _saw(data, state, white, data.outputs - state.predicted, rejected)
    components += [first] if first is not None else []
    caution = 1.0
    for number in range(ROUNDS):
        X, blocks, scales = whitened(state, values, components, scales, white)
        g = gram(X, blocks, scales, b)
        if number == 0:
            X, scales = beside_base(X, g, b)
            g = gram(X, blocks, scales, b)
            largest = LARGEST * g.squares / g.rows * floor**2
            most |= {c.name: largest for c in components if not c.noise}
        limit = caution * (max(ENTER, COARSE[number] * g.squares) if number < len(COARSE) else ENTER)
        before = set(variances)
        kept = values, dict(variances), state
        sizes = estimate(g, variances, most)
        sizes, steps = _select(g, sizes, components, most, limit, number >= len(COARSE))
        path += steps
        values = coefficients(g, sizes)
        variances = dict(sizes.variances)
        reshaped = _refined(components, g, sizes, X, b, state, scales, white)
        if reshaped is not None:
            components, values = reshaped, kept[0]
            X, blocks, scales = whitened(state, values, components, scales, white)
            g = gram(X, blocks, scales, b)
            sizes = estimate(g, variances, most)
            values, variances = coefficients(g, sizes), dict(sizes.variances)
        moved = state_at(data, values, components)
        change = float(np.sqrt(np.mean(((moved.predicted - state.predicted) / white) ** 2)))
        state = moved
        worse = float(np.sqrt(np.mean(((data.outputs - moved.predicted) / white) ** 2)))
        if worse > 1.2 * np.sqrt(g.squares / g.rows) + 3.0:  # components against each other: the step is not taken
            values, variances, state = kept
            saws = {c.name for c in components if c.cause == "quantisation"} & set(sizes.variances)
            rejected += [c.shape[0] for c in components if c.name in saws]
            components = [c for c in components if c.name not in saws]
            variances = {k: v for k, v in variances.items() if k not in saws}
            values = Values(values.base, {k: v for k, v in values.of.items() if k not in saws})
            caution *= 1.0 if saws else 30.0
            continue
        if not any(c.cause == "quantisation" for c in components):
            extra = _saw(data, state, white, data.outputs - state.predicted, rejected)
            if extra is not None:
                components = [*components, extra]
                continue
        if number >= len(COARSE) and set(variances) == before and change < 0.03:
            break
    X, blocks, scales = whitened(state, values, components, scales, white)
    g = gram(X, blocks, scales, b)
    sizes = estimate(g, variances, most)
    values = coefficients(g, sizes)
    return SearchResult(data, white, components, g, X, sizes, values, state_at(data, values, components), path)


def _select(
    g: Gram, sizes: Sizes, components: Sequence[Component], most: Mapping[str, float], limit: float, last: bool
) -> tuple[Sizes, list[str]]:
    """Components added, exchanged and removed until nothing gains more than `limit`."""
    by_name = {c.name: c for c in components}
    steps: list[str] = []
    seen: set[frozenset[str]] = set()
    sizes = _pruned(g, sizes, by_name, most, steps)
    stale: dict[str, float] = {}
    while len(sizes.variances) < MOST_COMPONENTS:
        best = _best(g, sizes, by_name, stale)
        enough = max(limit, SPILL * (sizes.deviance - g.rows))
        if (best is None or best[1] <= enough) and stale:
            stale = {}
            best = _best(g, sizes, by_name, stale)
        if best is not None and best[1] > enough:
            sizes = estimate(g, {**sizes.variances, best[0]: best[2]}, most, 12)
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


def _best(
    g: Gram, sizes: Sizes, by_name: Mapping[str, Component], stale: dict[str, float] | None = None
) -> tuple[str, float, float] | None:
    """The component that gains most, price taken off, and its variance.

    Gains mostly fall when components are added: with `stale` gains of an earlier call the most promising are computed
    first, until none of the others promises more.
    """
    taken = {by_name[name].family for name in sizes.variances} - {""}
    names = [n for n, c in by_name.items() if n not in sizes.variances and c.family not in taken and n in g.blocks]
    known = {} if stale is None else stale
    names.sort(key=lambda n: -known.get(n, np.inf))
    best: tuple[str, float, float] | None = None
    for part in [names[k : k + 6] for k in range(0, len(names), 6)] if known else [names]:
        if not part or (best is not None and best[1] > known.get(part[0], np.inf)):
            break
        for n, (gained, variance) in gains(g, sizes, part).items():
            known[n] = gained - by_name[n].price
            if best is None or known[n] > best[1]:
                best = n, known[n], variance
    return best


def _pruned(
    g: Gram, sizes: Sizes, by_name: Mapping[str, Component], most: Mapping[str, float], steps: list[str]
) -> Sizes:
    """Without components whose loss costs less than they must gain, the least first."""
    while True:
        costs = {n: loss(g, sizes, n) - by_name[n].price for n in sizes.variances if not by_name[n].noise}
        if not costs:
            return sizes
        name = min(costs, key=lambda n: costs[n])
        if costs[name] > LEAVE:
            return sizes
        rest = {k: v for k, v in sizes.variances.items() if k != name}
        after = estimate(g, rest, most, 12)
        if after.deviance - sizes.deviance - by_name[name].price > LEAVE:
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
        lost = others.deviance - sizes.deviance - by_name[name].price
        best = _best(g, others, by_name)
        if best is None or best[0] == name or best[1] < lost + 1.0:
            continue
        tried = estimate(g, {**others.variances, best[0]: best[2]}, most, 12)
        better = sizes.deviance + by_name[name].price - tried.deviance - by_name[best[0]].price
        if better > 1.0:
            steps.append(f"{name}>{best[0]}")
            sizes = tried
    return sizes


def _refined(
    components: list[Component],
    g: Gram,
    sizes: Sizes,
    X: Array,
    b: int,
    state: State,
    scales: Mapping[str, float],
    white: Array,
) -> list[Component] | None:
    """The active components at their likeliest shapes, the others held; None: no change."""
    changed = list(components)
    moved = False
    for i, comp in enumerate(components):
        if comp.name not in sizes.variances or comp.reshaped is None:
            continue
        rest = without(g, sizes, comp.name)

        def gained(shape: tuple[float, ...], comp: Component = comp, rest: Sizes = rest) -> float:
            assert comp.reshaped is not None
            J = comp.reshaped(shape).jacobian(state) / scales[comp.name] / white[:, :, None]
            return gain_of_columns(g, rest, X, b, J.reshape(-1, J.shape[2]))[0]

        best = _climbed(gained, comp.shape, comp.step)
        if best != comp.shape:
            changed[i] = comp.reshaped(best)
            moved = True
    return changed if moved else None


def _climbed(
    gained: Callable[[tuple[float, ...]], float], shape: tuple[float, ...], step: tuple[float, ...]
) -> tuple[float, ...]:
    """The shape of greatest gain nearby: each value in turn, by a parabola through three points, steps halved."""
    best, top = list(shape), gained(shape)
    for _ in range(3):
        for k in range(len(best)):
            size = step[k]
            for _ in range(5):
                sides = []
                for sign in (-1.0, 1.0):
                    tried = tuple(v + sign * size if j == k else v for j, v in enumerate(best))
                    sides.append((gained(tried), tried))
                value, tried = max(sides)
                if value > top:
                    top, best = value, list(tried)
                else:
                    size *= 0.4
        step = tuple(0.2 * s for s in step)
    return tuple(best)


def _saw(data: Measurement, state: State, white: Array, left: Array, rejected: Sequence[float]) -> Component | None:
    """The significant saw of a quantiser that the residual `left` (channels, n) shows best.

    rejected  frequencies of rejected saws; one with more than SAW_REJECTIONS is not proposed again
    """
    span = float(np.ptp(data.outputs)) or 1.0
    noise = float(np.median(data.std)) if data.std is not None else 0.0
    highest = min(SAW_VISIBLE / noise if noise > 0 else np.inf, 20_000 / SAW_POINTS / span)
    step = 1 / (SAW_POINTS * span)
    frequencies = step * np.arange(int(np.ceil(3 / span / step)), int(highest / step))
    if not len(frequencies):
        return None
    at = state.response.ravel()
    values = (left / white**2).ravel()
    weights = (1 / white**2).ravel()
    power = _spectrum(at, values, step, int(highest / step))[-len(frequencies) :] * 2 / np.sum(weights)
    for f in rejected:
        close = np.abs(frequencies - f) * span < 1.0
        if sum(abs(other - f) * span < 1.0 for other in rejected) > SAW_REJECTIONS:
            power[close] = 0.0
    best = int(np.argmax(power))
    price = 2 * np.log(len(frequencies) / SAW_POINTS)
    if power[best] < price + ENTER:
        return None
    fine = frequencies[best] + np.linspace(-1, 1, 41) / (SAW_POINTS * span)
    power = np.abs(np.exp(-2j * np.pi * np.outer(fine, at)) @ values) ** 2
    return saw(float(fine[int(np.argmax(power))]), 3, price)


def _spectrum(at: Array, values: Array, step: float, count: int) -> Array:
    """|sum of values exp(-2 pi i f at)|^2 at f = 0, step, .. (count,), by a fine histogram and a fast transform."""
    bins = 1 << int(np.ceil(np.log2(8 * count)))
    place = (at - at.min()) * step * bins
    lower = np.floor(place).astype(int)
    share = place - lower
    grid = np.bincount(lower % bins, values * (1 - share), bins) + np.bincount((lower + 1) % bins, values * share, bins)
    return np.asarray(np.abs(np.fft.rfft(grid)[:count]) ** 2)
