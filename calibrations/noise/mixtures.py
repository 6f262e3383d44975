"""Every mixture of noise effects added to a model, and the mixture with the best gain for its price.

The price of an effect is a gain in log-likelihood that noise alone rarely reaches, so that the whole search rarely
names an effect by chance. Mixtures are few, and the search tries all: the result does not depend on an order.

A power is not negative: where an effect is absent, twice its gain in log-likelihood is 0 or, half of the time,
chi-squared. If its shape is searched for, the gain is the maximum of many correlated gains along a curve on the unit
sphere; a curve of length L adds L / (2 pi) exp(-gain / 2), a chi-squared term of two degrees of freedom. Gains of
channels add up.

Source  Self and Liang, J. Am. Statist. Assoc. 82 (1987): likelihood ratios at a bound; Hotelling, Am. J. Math. 61
        (1939), and Davies, Biometrika 74 (1987): tubes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc

from calibrations.criteria import LEAST_GAINS, SIGNIFICANT
from calibrations.effects import Effect
from calibrations.noise.fit import fit_effects, shape_grid
from calibrations.noise.likelihood import ChannelFit, effect_spectrum
from calibrations.table import Array

STEPS_PER_SHAPE = 4  # steps along the curve to one that is tried
MOST_GAIN = 1e3


def chance(gain: float, tubes: Sequence[float]) -> float:
    """P-value of a gain that is summed over channels; `tubes` has L / (2 pi) of each channel."""
    weights = np.ones(1)  # of chi-square with 0, 1, 2 ... degrees of freedom
    for tube in tubes:
        weights = np.convolve(weights, [0.5, 0.5, tube])
    if gain <= 0:
        return 1.0
    return float(min(1.0, sum(w * chdtrc(k, gain) for k, w in enumerate(weights) if k)))


@lru_cache(maxsize=256)  # that of processes without a shape is the same for all records
def least_gain(of_chance: float, tubes: tuple[float, ...]) -> float:
    """The gain that noise alone exceeds with this probability."""
    return float(brentq(lambda gain: chance(gain, tubes) - of_chance, 1e-3, MOST_GAIN))


def tube(fit: ChannelFit, effect: Effect) -> float:
    """L / (2 pi) of an effect's shapes, given the effects of a fit; 0 for an effect without a shape."""
    if len(effect.parameters) < 2:
        return 0.0
    strength, shape = (p.name for p in effect.parameters[:2])
    ends = shape_grid(effect, shape, fit.channel)
    shapes = np.geomspace(ends[0], ends[-1], STEPS_PER_SHAPE * len(ends)).tolist()
    columns = np.column_stack([effect_spectrum(effect, fit.parts, {strength: 1.0, shape: value}) for value in shapes])
    unit = _orthogonal_units(columns, fit)
    steps = np.clip(np.sum(unit[:, 1:] * unit[:, :-1], axis=0), -1.0, 1.0)
    return float(np.sum(np.arccos(steps)) / (2 * np.pi))


def _orthogonal_units(columns: Array, fit: ChannelFit) -> Array:
    """Columns (b, k) of spectra as unit vectors that are orthogonal to the effects of the fit."""
    weight = (np.sqrt(fit.freedom / 2) / fit.expected)[:, None]
    effect_columns = np.column_stack(
        [effect_spectrum(e, fit.parts, {**fit.values[e.name], e.parameters[0].name: 1.0}) for e in fit.effects]
    )
    basis, _ = np.linalg.qr(effect_columns * weight / np.linalg.norm(effect_columns * weight, axis=0))
    free = columns * weight
    free = free - basis @ (basis.T @ free)
    return np.asarray(free / np.linalg.norm(free, axis=0))


@dataclass(frozen=True)
class Mixture:
    """Effects added to a model, fitted to each channel; the gain over the model; the gain minus the prices (score)."""

    effects: tuple[Effect, ...]
    channels: tuple[ChannelFit, ...]
    gain: float
    score: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the added effects."""
        return tuple(effect.name for effect in self.effects)


@dataclass(frozen=True)
class Mixtures:
    """The spectra of the channels, the effects of the model, and those that may be missing."""

    seen: tuple[ChannelFit, ...]
    given: tuple[Effect, ...]
    missing: tuple[Effect, ...]

    @cached_property
    def base(self) -> tuple[ChannelFit, ...]:
        """The model alone."""
        return self._fitted(())

    @cached_property
    def tubes(self) -> dict[str, tuple[float, ...]]:
        """L / (2 pi) of each missing effect, by channel."""
        return {effect.name: tuple(tube(fit, effect) for fit in self.base) for effect in self.missing}

    @cached_property
    def prices(self) -> dict[str, float]:
        """Price of each missing effect."""
        chance = SIGNIFICANT / max(1, len(self.missing))
        return {name: max(LEAST_GAINS.get(name, 0.0), least_gain(chance, tubes)) for name, tubes in self.tubes.items()}

    def of(self, effects: Iterable[Effect]) -> Mixture:
        """The model with some of the missing effects."""
        effects = tuple(effects)
        channels = self._fitted(effects)
        gain = 2 * (likelihood(channels) - likelihood(self.base))
        return Mixture(effects, channels, gain, gain - sum(self.prices[effect.name] for effect in effects))

    @cached_property
    def best(self) -> Mixture:
        """The mixture with the highest score.

        No mixture gains more than one that contains it: this bound saves the fit of mixtures with too high a price.
        Shapes take longest to fit: mixtures with few of them come first.
        """
        best, fitted = self.of(()), [self.of(self.missing)]
        subsets = [subset for k in range(1, len(self.missing) + 1) for subset in combinations(self.missing, k)]
        for subset in sorted(subsets, key=lambda subset: sum(len(effect.parameters) > 1 for effect in subset)):
            highest_gain = min(wider.gain for wider in fitted if set(subset) <= set(wider.effects))
            if highest_gain - sum(self.prices[effect.name] for effect in subset) > best.score:
                fitted.append(self.of(subset))
                best = max(best, fitted[-1], key=lambda mixture: mixture.score)
        return best

    def lost_without(self, mixture: Mixture, name: str) -> float:
        """Twice the log-likelihood that a mixture loses without one of its effects."""
        smaller = self.of(effect for effect in mixture.effects if effect.name != name)
        return mixture.gain - smaller.gain

    def _fitted(self, effects: Sequence[Effect]) -> tuple[ChannelFit, ...]:
        return tuple(fit_effects(fit, (*self.given, *effects)) for fit in self.seen)


def likelihood(channels: Iterable[ChannelFit]) -> float:
    """Log-likelihood of all channels together."""
    return sum(channel.log_likelihood for channel in channels)
