"""Every mixture of noise effects beside a model, and the one that the record makes most likely for its price.

The price of an effect is the gain in log-likelihood that noise alone would make so rarely that over the whole search
nothing is named by chance. Mixtures are few, and all are tried: what is named does not depend on the order.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

from calibrations.effect import Effect
from calibrations.search.candidates import SIGNIFICANT
from calibrations.still.chance import least_gain, tube
from calibrations.still.channel_fit import ChannelFit
from calibrations.still.fit import with_effects

PRICES: Mapping[str, float] = {  # twice the log-likelihood, at least
    "quantisation-noise": 12.0,  # taken for white noise that is there, it would falsify that most
    "gauss-markov-noise": 22.0,  # a shape that others together can nearly take on
}


@dataclass(frozen=True)
class Mixture:
    """Effects beside a model, fitted to each channel; the gain over the model, and that less the effects' prices."""

    effects: tuple[Effect, ...]
    channels: tuple[ChannelFit, ...]
    gain: float
    worth: float

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects beside the model."""
        return tuple(effect.name for effect in self.effects)


@dataclass(frozen=True)
class Mixtures:
    """What is seen in each channel, the effects of the model, and those that might be missing."""

    seen: tuple[ChannelFit, ...]
    given: tuple[Effect, ...]
    others: tuple[Effect, ...]

    @cached_property
    def base(self) -> tuple[ChannelFit, ...]:
        """The model alone."""
        return self._fitted(())

    @cached_property
    def tubes(self) -> dict[str, tuple[float, ...]]:
        """Of each of the others, per channel."""
        return {effect.name: tuple(tube(each, effect) for each in self.base) for effect in self.others}

    @cached_property
    def prices(self) -> dict[str, float]:
        """Of each of the others."""
        chance = SIGNIFICANT / max(1, len(self.others))
        return {name: max(PRICES.get(name, 0.0), least_gain(chance, tubes)) for name, tubes in self.tubes.items()}

    def of(self, effects: Iterable[Effect]) -> Mixture:
        """The model with some of the others."""
        effects = tuple(effects)
        channels = self._fitted(effects)
        gain = 2 * (likelihood(channels) - likelihood(self.base))
        return Mixture(effects, channels, gain, gain - sum(self.prices[effect.name] for effect in effects))

    @cached_property
    def all(self) -> tuple[Mixture, ...]:
        """Every one, the most worth first."""
        subsets = (subset for k in range(len(self.others) + 1) for subset in combinations(self.others, k))
        return tuple(sorted((self.of(subset) for subset in subsets), key=lambda each: -each.worth))

    @property
    def best(self) -> Mixture:
        """The one that is worth most."""
        return self.all[0]

    def lost_without(self, mixture: Mixture, name: str) -> float:
        """Twice the log-likelihood that a mixture loses without one of its effects."""
        rest = self.of(effect for effect in mixture.effects if effect.name != name)
        return mixture.gain - rest.gain

    def _fitted(self, effects: Sequence[Effect]) -> tuple[ChannelFit, ...]:
        return tuple(with_effects(each, (*self.given, *effects)) for each in self.seen)


def likelihood(channels: Iterable[ChannelFit]) -> float:
    """Logarithm, of all channels together."""
    return sum(each.log_likelihood for each in channels)
