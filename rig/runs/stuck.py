"""Outputs that are stuck: they give equal samples where noise or gravity must change them.

A pose with such an output is refused when it is recorded, whatever the converter is. There are two rules.

noise    A run of equal samples that the noise of this output at rest does not explain. Each sample is equal to the one
         before with some probability. If it is below EVEN, the noise covers several steps of the resolution, and then
         it does not matter where the mean is between two steps. So n more equal samples have a probability of at most
         the n-th power. Motion adds to the noise, so samples in motion are tested as well, but do not count for this
         probability.
gravity  The same constant value at poses between which the specific force along this axis changes by LEAST_G or more,
         and by half of the whole change or more. A sound output with this property is mounted more than 30 deg from its
         axis, or its step is larger than LEAST_G. This rule needs no noise: it also judges a coarse, quiet sensor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from drivers.errors import SensorFault
from drivers.recorder import Samples
from procedures import hand_turns, motion
from procedures.instruments import OUTPUTS
from procedures.session import Dwell, Pose
from rig.record.measured import specific_force_g

EVEN = 0.5
STANDARD_ERRORS = 5.0  # of the upper limit of a probability from counts
CHANCE = 1e-12  # that a sound output begins such a run of equal samples, at each sample
LEAST_G = 0.2
ROUNDING = 1e-9  # of a mean: larger than that of a mean of equal samples, smaller than a step of any converter
MOVING = (motion.KIND, hand_turns.KIND)  # kinds of runs whose poses are partly in motion: the noise is not known
REMEDY = (
    "Switch the sensor off and on, check its cable, and check that the output is the right one; then resume the run, "
    "which measures the poses since then again"
)


@dataclass
class StepCounts:
    """The steps from a sample of an output to the next one, and those without a change."""

    total: int = 0
    equal: int = 0

    def add(self, equal: int, changes: int) -> None:
        """Add `equal` steps without a change, and `changes`."""
        self.total += equal + changes
        self.equal += equal

    @property
    def most_equal(self) -> float:
        """Upper limit of the probability of a step without a change (Wilson's interval)."""
        if not self.total:
            return 1.0
        share, z2 = self.equal / self.total, STANDARD_ERRORS**2 / self.total
        return (share + z2 / 2 + math.sqrt(z2 * share * (1 - share) + z2**2 / 4)) / (1 + z2)

    def excludes(self, count: int) -> bool:
        """Whether a sound output does not give `count` equal samples in succession."""
        return self.most_equal <= EVEN and (count - 1) * math.log(self.most_equal) < math.log(CHANCE)


@dataclass(frozen=True)
class EqualRun:
    """Successive equal samples of an output, up to its last one; the first of them was taken at `since_s`.

    `at_rest`: all of them were taken at rest.
    """

    value: float
    count: int
    since_s: float
    at_rest: bool


@dataclass(frozen=True)
class Constant:
    """An output without any change at successive poses, from that at `since_s` on, with their specific forces in g."""

    value: float
    since_s: float
    forces: tuple[tuple[float, ...], ...] = ()

    def has(self, value: float) -> bool:
        """Whether `value` is the same."""
        return abs(value - self.value) <= ROUNDING * abs(self.value)

    def at(self, pose: Pose) -> Constant:
        """The same, also at `pose`."""
        force = tuple(specific_force_g(pose).tolist())
        return self if force in self.forces else replace(self, forces=(*self.forces, force))

    def is_stuck(self, axis: int) -> bool:
        """Whether the last force differs from another one along `axis`."""
        changes = np.array(self.forces) - self.forces[-1]
        along = np.abs(changes[:, axis])
        return bool(np.any((along >= LEAST_G) & (along >= np.linalg.norm(changes, axis=1) / 2)))


@dataclass
class StuckOutputs:
    """The state of the outputs of the sensor after the poses so far. `kind` is that of the run."""

    kind: str = "poses"
    _steps: dict[str, StepCounts] = field(default_factory=dict)  # these three by output
    _equal: dict[str, EqualRun] = field(default_factory=dict)
    _constant: dict[str, Constant] = field(default_factory=dict)

    def recall(self, dwells: Iterable[Dwell], zero_s: float) -> None:
        """Begin with the poses of an earlier part of the run. `zero_s`: the clock's time at t = 0."""
        for dwell in dwells:
            values = {name: mean for name, mean in dwell.means.items() if dwell.stds[name] <= ROUNDING * abs(mean)}
            self._note_constant(dwell.pose, values, dwell.means, zero_s + dwell.t_s)

    def require_alive(self, pose: Pose, samples: Samples) -> None:
        """Add a pose. Raises SensorFault for an output that is stuck in it."""
        at_rest = self.kind not in MOVING and not pose.rate_deg_s
        for name, values in zip(samples.channels, samples.volts.T, strict=True):
            self._note_equal(name, values, samples, at_rest)
        is_constant = np.ptp(samples.volts, axis=0) == 0
        constant = {name: float(samples.volts[0, k]) for k, name in enumerate(samples.channels) if is_constant[k]}
        middle_s = samples.start_s + len(samples.volts) / samples.rate_hz / 2
        self._note_constant(pose, constant, samples.channels, middle_s)
        for name, chain in self._constant.items():
            if chain.is_stuck(_axis(name)):
                raise SensorFault(
                    f"adc: {name} gave the same value at {len(chain.forces)} attitudes, although the specific force "
                    "along it changed: it is stuck",
                    REMEDY,
                    chain.since_s,
                )

    def _note_equal(self, name: str, values: NDArray[np.float64], samples: Samples, at_rest: bool) -> None:
        """Count the equal samples of an output. Raises SensorFault for too many in succession."""
        ends = np.append(np.flatnonzero(np.diff(values) != 0), len(values) - 1)  # of runs of equal samples
        counts = np.diff(ends, prepend=-1)
        first_s = samples.start_s + (ends - counts + 1) / samples.rate_hz
        steps, earlier = self._steps.setdefault(name, StepCounts()), self._equal.get(name)
        if earlier is not None and earlier.value == values[0]:
            counts[0] += earlier.count
            first_s[0] = earlier.since_s
        elif earlier is not None and earlier.at_rest:
            steps.add(earlier.count - 1, 0)  # a change from pose to pose is no noise
        longest = int(np.argmax(counts))
        if steps.excludes(int(counts[longest])):
            raise SensorFault(
                f"adc: {name} gave the same value {counts[longest]} times in succession, but before, its noise changed "
                f"{100 * (1 - steps.equal / steps.total):.0f} % of the samples: it is stuck",
                REMEDY,
                float(first_s[longest]),
            )
        if at_rest:
            steps.add(int((counts[:-1] - 1).sum()), len(counts) - 1)
        self._equal[name] = EqualRun(float(values[-1]), int(counts[-1]), float(first_s[-1]), at_rest)

    def _note_constant(self, pose: Pose, constant: Mapping[str, float], names: Iterable[str], at_s: float) -> None:
        """Note the outputs of an accelerometer with a constant value at `pose`; the others change."""
        for name in names:
            if name not in constant or _axis(name) < 0:
                self._constant.pop(name, None)
                continue
            chain = self._constant.get(name)
            if chain is None or not chain.has(constant[name]):
                chain = Constant(constant[name], at_s)
            self._constant[name] = chain.at(pose)


def _axis(channel: str) -> int:
    """The axis of an accelerometer's output, 0 to 2, also of a sensor of a batch; -1 for another channel."""
    name = channel.rpartition(".")[2]
    return next((names.index(name) for names in OUTPUTS if name in names), -1)
