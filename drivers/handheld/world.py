"""The simulated world with a sensor in a hand: an accelerometer (inputs ax, ay, az of the converter), a gyroscope
(gx, gy, gz) and a magnetometer (mx, my, mz) that turn together.

Gyroscope and magnetometer are those of `drivers.world.turned_sensors`, and their field is that of the laboratory, whose
magnet and iron are fixed to the table. A bench file has the hand and its accelerometer under `world`, as `hand` and
`triad`; `{}` takes the defaults.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from drivers.handheld.hand import Hand, Script
from drivers.handheld.motion import Motion
from drivers.handheld.triad import Mass, Triad, individual, noise_v, steady_v
from drivers.world import laboratory, turned_sensors
from drivers.world.config import WorldConfig, changed_settings
from drivers.world.digital import TRIMS, Trim
from drivers.world.errors import BadSetting
from drivers.world.gravity import Base
from drivers.world.kernel import Floats
from drivers.world.laboratory import Laboratory
from drivers.world.mechanics import REFERENCE_C
from drivers.world.world import World

FORCES, RATES, FIELDS = ("ax", "ay", "az"), ("gx", "gy", "gz"), ("mx", "my", "mz")
INPUTS = (*FORCES, *RATES, *FIELDS)
KEYS = ("hand", "triad")
OWN_TRIMS = MappingProxyType({**TRIMS, **{name: Trim(name, Mass.zero_v, Mass.volts_per_g) for name in FORCES}})


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
            raise BadSetting(f"{key} of the simulated world is {value!r}", "Give a mapping; {} uses the defaults")
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

    def turn_by_hand(self, up: Sequence[float], north: Sequence[float] = ()) -> None:
        """Tell the hand which direction (3,) of the sensor's frame shall be upward, and which to the north, if any."""
        self.script.turn_to(
            np.asarray(up, dtype=float), self.now_s, np.asarray(north, dtype=float) if len(north) else None
        )

    def adc_volts(
        self, inputs: Sequence[str], start_s: float, interval_s: float, n: int, places: Sequence[int] | None = None
    ) -> Floats:
        """Voltages as from `World.adc_volts`; the inputs of INPUTS are also sampled, all at the start of a scan."""
        own_places = [k for k, name in enumerate(inputs) if name in INPUTS]
        if not own_places:
            return super().adc_volts(inputs, start_s, interval_s, n, places)
        other_places = [k for k in range(len(inputs)) if k not in own_places]
        volts = np.empty((n, len(inputs)))
        times_s = np.asarray(start_s + interval_s * np.arange(n), dtype=np.float64)
        motion = self.script.motion(times_s)
        for names, sensor in ((FORCES, self._triad_v), (RATES, self._gyroscope_v), (FIELDS, self._magnetometer_v)):
            if own := [k for k in own_places if inputs[k] in names]:
                volts[:, own] = sensor(motion, interval_s)[:, [names.index(inputs[k]) for k in own]]
        if other_places:
            positions = other_places if places is None else [places[k] for k in other_places]
            volts[:, other_places] = super().adc_volts(
                [inputs[k] for k in other_places], start_s, interval_s, n, positions
            )
        else:
            self.advance(start_s + interval_s * (n - 1))
        return volts

    def _triad_v(self, motion: Motion, interval_s: float) -> Floats:
        noise = noise_v(self.triad, self._memory, self._wander, interval_s, len(motion.force_g), self._noise_random)
        self._memory, self._wander = noise[1:]
        return np.asarray(steady_v(self.triad, motion.force_g) + noise[0])

    def _gyroscope_v(self, motion: Motion, interval_s: float) -> Floats:  # noqa: ARG002 - its noise is white
        """The sensor turns with the hand and with the earth."""
        sensor, volts = self.config.gyroscope, np.empty((len(motion.rate_deg_s), 3))
        earth_deg_s = laboratory.rotation_deg_s(self._place, Base())
        rates_deg_s = motion.rate_deg_s + motion.attitude @ earth_deg_s
        turned_sensors.gyroscope_volts(
            self._numbers.gyroscope, turned_sensors.die(sensor), rates_deg_s, motion.force_g, self._warmer_k, volts
        )
        return np.asarray(volts + sensor.noise_v * self._noise_random.standard_normal(volts.shape))

    def _magnetometer_v(self, motion: Motion, interval_s: float) -> Floats:  # noqa: ARG002 - its noise is white
        sensor, volts = self.config.magnetometer, np.empty((len(motion.attitude), 3))
        fields_ut = np.einsum("nij,nj->ni", motion.attitude, self._fields_ut(motion.place_mm))
        turned_sensors.magnetometer_volts(
            self._numbers.magnetometer, turned_sensors.normals(sensor), fields_ut, self._warmer_k, volts
        )
        return np.asarray(volts + sensor.noise_v * self._noise_random.standard_normal(volts.shape))

    @property
    def _place(self) -> Laboratory:
        """The laboratory with x to the north, y to the west and z upward, as the attitudes of a hand."""
        return replace(self.config.laboratory, heading_deg=0.0)

    @property
    def _warmer_k(self) -> float:
        return self.die_c() - REFERENCE_C

    def _fields_ut(self, places_mm: Floats) -> Floats:
        """The field at each place on the table (n, 2), shape (n, 3)."""
        places, which = np.unique(places_mm, axis=0, return_inverse=True)
        return np.array([self._field_ut(x_mm, y_mm) for x_mm, y_mm in places])[which.ravel()]

    def _field_ut(self, x_mm: float, y_mm: float) -> Floats:
        """The field at the sensor, uT. Magnet and iron have their places relative to the middle of the table."""
        place = self._place
        magnet = replace(place.magnet, x_mm=place.magnet.x_mm - x_mm, y_mm=place.magnet.y_mm - y_mm)
        iron = replace(place.iron, x_mm=place.iron.x_mm - x_mm, y_mm=place.iron.y_mm - y_mm)
        return laboratory.field_ut(replace(place, magnet=magnet, iron=iron), Base())

    def state(self) -> dict[str, Any]:
        """All that the world remembers, with the hand."""
        generators = [g.bit_generator.state for g in (self._hand_random, self._noise_random)]
        noise = {"memory": self._memory.tolist(), "wander": self._wander.tolist()}
        return {**super().state(), "hand": {"script": self.script.state(), "generators": generators, **noise}}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a result of `state`."""
        super().restore(state)
        hand = state["hand"]
        self.script.restore(hand["script"])
        self._memory, self._wander = np.array(hand["memory"]), np.array(hand["wander"])
        for generator, generator_state in zip((self._hand_random, self._noise_random), hand["generators"], strict=True):
            generator.bit_generator.state = generator_state
