"""The input of a search, a point on its way, and the result at a point.

The result has all that the places, their causes and the geometry are derived from.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibrations.free_forms.chain import Coefficients, ModelEffects, State, base_size, start, state_at
from calibrations.free_forms.components import Component
from calibrations.free_forms.jumps import find_jumps
from calibrations.free_forms.places import components as all_components
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.reml import (
    Gram,
    Sizes,
    coefficients,
    estimate,
    gram,
    scale_components,
    whiten,
    without,
)
from calibrations.free_forms.selection import ENTER, prices
from calibrations.means.noise import rms
from calibrations.table import Array

MOST_SLOW = 1.0  # noise floors (rms) that limited slow noise takes up: more is something that moves with time
NOISE_ALONE = 1.04  # residual over noise, up to which it is noise
MISFIT = 1.08  # mean square of the residual over the noise: from there on steps over the output are tried


@dataclass(frozen=True, eq=False)
class Setting:
    """The input of a descent.

    white    standard deviation of each mean, (channels, n)
    flicker  whether slow noise may be of any size
    """

    data: PoseData
    white: Array
    model_effects: ModelEffects
    flicker: bool = False

    @property
    def floor(self) -> float:
        """The noise of a mean, rms."""
        return float(np.sqrt(np.mean(self.white**2)))

    @property
    def base_size(self) -> int:
        """Number of base columns."""
        return base_size(self.data, self.model_effects)

    def slow_limits(self, components: Iterable[Component], most: float) -> dict[str, float]:
        """Limits of the variances of slow noise; `most` in noise floors."""
        return {} if self.flicker else {c.name: (most * self.floor) ** 2 for c in components if c.noise}

    def state_at(self, values: Coefficients, components: Sequence[Component]) -> State:
        """All signals of the chain."""
        return state_at(self.data, self.model_effects, values, components)

    def linearise(self, point: Point, scales: Mapping[str, float]) -> tuple[Array, Gram]:
        """Columns [base, components, data] over the noise, and their products."""
        X, blocks, all_scales = whiten(
            point.state, self.model_effects, point.values, point.components, scales, self.white
        )
        return X, gram(X, blocks, all_scales, self.base_size, self.data.channels)

    @cached_property
    def first_jumps(self) -> Component | None:
        """Steps over the output beside everything smooth that these poses can show, whether it acts or not."""
        values = start(self.data, self.model_effects)
        state = self.state_at(values, ())
        misfit = self.misfit(state)
        if misfit < MISFIT:
            return None
        components = [c for c in all_components(self.data, state) if not c.general and not c.has_loops]
        X, g = self.linearise(Point(components, {}, values, state), {})
        X, g = scale_components(X, g)
        sizes = estimate(g, {c.name: misfit * self.floor**2 for c in components}, {}, rounds=0)
        return find_jumps(state, self.white, X, g, sizes)

    def misfit(self, state: State) -> float:
        """Mean square of the residual over the noise."""
        return float(np.mean(((self.data.outputs - state.predicted) / self.white) ** 2))

    def change(self, before: State, after: State) -> float:
        """Change of the output, rms in noise floors."""
        return float(np.sqrt(np.mean(((after.predicted - before.predicted) / self.white) ** 2)))


@dataclass(frozen=True, eq=False)
class Point:
    """A point of a descent: all components, the variances of those that act, and the chain at their coefficients."""

    components: Sequence[Component]
    variances: Mapping[str, float]
    values: Coefficients
    state: State

    def without(self, names: Iterable[str]) -> Point:
        """Without components that have not changed the state yet."""
        left_out = set(names)
        return Point(
            [c for c in self.components if c.name not in left_out],
            {name: v for name, v in self.variances.items() if name not in left_out},
            Coefficients(self.values.base, {k: v for k, v in self.values.of.items() if k not in left_out}),
            self.state,
        )


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The result of a descent or of a search."""

    setting: Setting
    components: Sequence[Component]
    gram: Gram
    columns: Array  # whitened [base, components, data]
    sizes: Sizes
    values: Coefficients
    state: State

    @property
    def data(self) -> PoseData:
        """The poses."""
        return self.setting.data

    @property
    def white(self) -> Array:
        """Standard deviation of each mean, (channels, n)."""
        return self.setting.white

    @property
    def point(self) -> Point:
        """Where the descent ended."""
        return Point(self.components, self.sizes.variances, self.values, self.state)

    def component(self, name: str) -> Component:
        return next(c for c in self.components if c.name == name)

    @property
    def residual(self) -> Array:
        """Whitened residual, (channels * n,)."""
        b, g = self.setting.base_size, self.gram
        rows = g.indices(self.sizes.variances)
        base = g.base_inverse @ (g.base_with_data - g.base_products[:, rows] @ self.sizes.coefficients)
        fitted = self.columns[:, :b] @ base + self.columns[:, b + rows] @ self.sizes.coefficients
        return np.asarray(self.columns[:, -1] - fitted)

    @cached_property
    def slow(self) -> Array:
        """What slow noise takes up, over the white noise, (channels * n,)."""
        b = self.setting.base_size
        slow = np.zeros(len(self.columns))
        for component in self.components:
            if component.noise and component.name in self.sizes.variances:
                block = self.gram.blocks[component.name]
                slow += self.columns[:, b + block.start : b + block.stop] @ self.sizes.of(self.gram, component.name)
        return slow

    @property
    def error(self) -> float:
        """Rms of what all components but slow noise leave, in the output's unit."""
        return float(np.sqrt(np.mean(((self.residual + self.slow) * self.white.ravel()) ** 2)))

    @property
    def leaves_noise(self) -> bool:
        """Whether what the components leave is noise: white noise, and no more slow noise than there may be."""
        slow = 0.0 if self.setting.flicker else float(rms(self.slow))
        return self.ratio < NOISE_ALONE and slow < MOST_SLOW

    @property
    def freedom(self) -> float:
        """Degrees of freedom that the residual keeps: rows less those that base and components take."""
        parameters = sum(
            self.gram.blocks[name].stop - self.gram.blocks[name].start - self.sizes.shrinkage(self.gram, name)
            for name in self.sizes.variances
        )
        return float(max(len(self.columns) - self.gram.base_rank - parameters, 1.0))

    def sizes_without(self, names: Iterable[str]) -> Sizes:
        """Sizes without some components, the other variances held."""
        sizes = self.sizes
        for name in names:
            sizes = without(self.gram, sizes, name)
        return sizes

    def cost_without(self, names: Iterable[str]) -> float:
        """Loss of twice the log-likelihood without some components, to first order."""
        return self.sizes_without(names).deviance - self.sizes.deviance

    @property
    def active(self) -> list[str]:
        return [name for name in self.sizes.variances if not self.component(name).noise]

    @property
    def ratio(self) -> float:
        """The residual over the noise."""
        return float(np.sqrt(self.residual @ self.residual / self.freedom))

    @property
    def criterion(self) -> float:
        """The minimised criterion: -2 log restricted likelihood, plus a price for each component that acts."""
        return self.sizes.deviance + ENTER * len(self.active) + prices(self.component(name) for name in self.active)


def finish(setting: Setting, point: Point, scales: Mapping[str, float], limits: Mapping[str, float]) -> SearchResult:
    """The result at a point, linearised once more."""
    X, g = setting.linearise(point, scales)
    sizes = estimate(g, point.variances, limits)
    values = coefficients(g, sizes)
    return SearchResult(setting, point.components, g, X, sizes, values, setting.state_at(values, point.components))
