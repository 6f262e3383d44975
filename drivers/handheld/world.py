"""The simulated world with a sensor in a hand: inputs ax, ay and az of the converter.

A bench file has the hand and its sensor under `world`, as `hand` and `triad`; `{}` takes the defaults.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from drivers.handheld.hand import Hand, Script
from drivers.handheld.triad import Mass, Triad, individual, noise_v, steady_v
from drivers.world.config import WorldConfig, changed_settings
from drivers.world.digital import TRIMS, Trim
from drivers.world.errors import BadSetting
from drivers.world.kernel import Floats
from drivers.world.world import World

INPUTS = ("ax", "ay", "az")
KEYS = ("hand", "triad")
OWN_TRIMS = MappingProxyType({**TRIMS, **{name: Trim(name, Mass.zero_v, Mass.volts_per_g) for name in INPUTS}})


@dataclass(frozen=True)
class Handheld:
    """A hand and the sensor in it."""

    hand: Hand = field(default_factory=Hand)
    triad: Triad = field(default_factory=Triad)


def handheld(settings: Mapping[str, Any]) -> tuple[dict[str, Any], Handheld | None]:
    """The other settings of a world, and the hand of these `settings`; None if they have none.

    Raises UnknownSetting, BadSetting.
    """
    other_settings = {key: value for key, value in settings.items() if key not in KEYS}
    hand_settings = {key: value for key, value in settings.items() if key in KEYS}
    for key, value in hand_settings.items():
        if not isinstance(value, Mapping):
            raise BadSetting(f"{key} of the simulated world is {value!r}", "Give a mapping; {} takes the defaults")
    return other_settings, changed_settings(Handheld(), hand_settings) if hand_settings else None


class HandheldWorld(World):
    """A world with a hand. The sensor lies on its -z side at first."""

    trims = OWN_TRIMS

    def __init__(self, config: WorldConfig, seed: int, handheld_settings: Handheld) -> None:
        super().__init__(config, seed)
        self._hand_random, self._noise_random = (np.random.default_rng([seed, 7, k]) for k in range(2))
        self.triad = individual(handheld_settings.triad, self._hand_random)
        self.script = Script(handheld_settings.hand, self._hand_random, np.array([0.0, 0.0, 1.0]))
        self._memory, self._wander = (
            np.zeros(3),
            handheld_settings.triad.wander_v * self._noise_random.standard_normal(3),
        )

    def turn_by_hand(self, up: Sequence[float]) -> None:
        """Tell the hand which direction (3,) of the sensor's frame shall be upward."""
        self.script.turn_to(np.asarray(up, dtype=float), self.now_s)

    def adc_volts(
        self, inputs: Sequence[str], start_s: float, interval_s: float, n: int, places: Sequence[int] | None = None
    ) -> Floats:
        """As `World.adc_volts`, with the inputs of INPUTS too, all three sampled at the begin of a scan."""
        triad_places = [k for k, name in enumerate(inputs) if name in INPUTS]
        if not triad_places:
            return super().adc_volts(inputs, start_s, interval_s, n, places)
        other_places = [k for k in range(len(inputs)) if k not in triad_places]
        volts = np.empty((n, len(inputs)))
        triad_v = self._triad_v(np.asarray(start_s + interval_s * np.arange(n), dtype=np.float64), interval_s)
        volts[:, triad_places] = triad_v[:, [INPUTS.index(inputs[k]) for k in triad_places]]
        if other_places:
            positions = other_places if places is None else [places[k] for k in other_places]
            volts[:, other_places] = super().adc_volts(
                [inputs[k] for k in other_places], start_s, interval_s, n, positions
            )
        else:
            self.advance(start_s + interval_s * (n - 1))
        return volts

    def _triad_v(self, times_s: Floats, interval_s: float) -> Floats:
        noise = noise_v(self.triad, self._memory, self._wander, interval_s, len(times_s), self._noise_random)
        self._memory, self._wander = noise[1:]
        return np.asarray(steady_v(self.triad, self.script.force_g(times_s)) + noise[0])

    def state(self) -> dict[str, Any]:
        """All that the world remembers, with the hand."""
        generators = [g.bit_generator.state for g in (self._hand_random, self._noise_random)]
        noise = {"memory": self._memory.tolist(), "wander": self._wander.tolist()}
        return {**super().state(), "hand": {"script": self.script.state(), "generators": generators, **noise}}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from what `state` gave."""
        super().restore(state)
        hand = state["hand"]
        self.script.restore(hand["script"])
        self._memory, self._wander = np.array(hand["memory"]), np.array(hand["wander"])
        for generator, generator_state in zip((self._hand_random, self._noise_random), hand["generators"], strict=True):
            generator.bit_generator.state = generator_state
