"""The faults of a simulated rig beside the effects that an analysis found: the table at the end of `rig demo`.

A fault is a mechanism of the simulation that the bench file sets. Its size is the rms change of the output without the
mechanism, at the same poses and without noise. The size of an effect is the rms change of the model's output without
the effect. Bias and scale factor are free in both, because every calibration fits them. An effect belongs to a fault if
their curves and sizes agree: nothing compares the name of an effect with that of a mechanism.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibrations.fitting.fit import Fit
from calibrations.fitting.identifiability import covariance
from calibrations.means.noise import rms
from calibrations.model.chain import forward
from calibrations.table import Array, Table
from calibrations.text import columns, quantity
from drivers.world.config import WorldConfig
from drivers.world.world import World
from rig.bench import Bench

ALIKE = 0.9  # correlation of two curves of one cause
OF_A_SIZE = 3.0  # their sizes differ by this factor at most
MATERIAL = 0.3  # times the noise floor: a smaller fault cannot be seen
STEP_STD = 0.1  # of a parameter, for the derivative of a size
AXES = ("x", "y")
QUIET_S = 0.5  # between samples: without noise they are alike, and few are enough


def _both(part: str, *names: str) -> tuple[str, ...]:
    return tuple(f"sensor.{axis}.{part}.{name}" for axis in AXES for name in names)


# Mechanisms by what a technician calls them: the settings of the world that make them.
MECHANISMS: Mapping[str, tuple[str, ...]] = {
    "sensor soldered at an angle": tuple(f"sensor.package.turn_{axis}_deg" for axis in "xyz"),
    "sensing axes not square": ("sensor.package.beams_off_square_deg",),
    "sensor tilted on the table": ("seating.tilt_deg", "seating.grip_pm"),
    "base not level": ("base.tilt_x_deg", "base.tilt_y_deg"),
    "offset of alpha's zero": ("stages.alpha.zero_offset_deg",),
    "offset of beta's zero": ("stages.beta.zero_offset_deg",),
    "gear play of the stages": ("stages.alpha.play_deg", "stages.beta.play_deg"),
    "wobble of the stages": ("stages.alpha.wobble_deg", "stages.beta.wobble_deg"),
    "worn worm gear": ("stages.alpha.worm_deg", "stages.beta.worm_deg"),
    "unequal or uneven plates": _both(  # one reading: each of these changes what the others do
        "plates", "plate_mismatch_fraction", "overlap_loss_per_um2", "height_step_nm", "stray_fraction"
    ),
    "charge in the oxide": _both("plates", "charging_pm"),
    "springs harden": _both("springs", "hardening_per_um2"),
    "load of the other axis": _both("springs", "foreshortening_per_um"),
    "sag of the mass": _both("springs", "sag_foreshortening_per_um"),
    "package bends as it warms": _both("springs", "stress_pm_per_k"),
    "springs soften as they warm": _both("springs", "stiffening_ppm_per_k"),
    "friction in the springs": _both("friction", "stiffness_fraction"),
    "self-heating": ("heat.board_rise_k", "heat.package_rise_k"),
    "play between warmth and stress": ("heat.glue_play_k",),
    "supply voltage wanders": ("supply.wander_v",),
}


@dataclass(frozen=True)
class Curve:
    """A change of the output, (n, channels), free of bias and scale factor. `std`: standard uncertainty of its rms."""

    name: str
    curve: Array
    std: float | None = None

    @property
    def size(self) -> float:
        """Rms over poses and channels."""
        return float(rms(self.curve.ravel()))


@dataclass(frozen=True)
class Match:
    """A hidden fault, and the effect that follows its curve at about its size; None if it was not found."""

    fault: Curve
    effect: Curve | None


@dataclass(frozen=True)
class Faults:
    """All faults beside all effects. `extra`: effects that follow no fault of their own. Sizes in `unit`."""

    matches: tuple[Match, ...]
    extra: tuple[Curve, ...]
    floor: float
    unit: str

    @property
    def material(self) -> tuple[Match, ...]:
        """Faults that are large enough to be seen."""
        return tuple(m for m in self.matches if m.fault.size >= MATERIAL * self.floor)

    def text(self) -> str:
        """The table hidden / found / uncertainty, and a line for the rest."""
        total = sum(m.fault.size**2 for m in self.matches) or 1.0
        rows = [self._row(m, total) for m in self.material]
        lines = [columns(("hidden fault", "hidden", "share", "found as", "found", "uncertainty"), rows)]
        if small := [m.fault.name for m in self.matches if m.fault.size < MATERIAL * self.floor]:
            lines.append(f"Too small to be seen, below {MATERIAL:g} noise floors: {', '.join(small)}.")
        if self.extra:
            found = ", ".join(f"{e.name} ({self._size(e)})" for e in self.extra)
            lines.append(f"Found, and not the curve of a single hidden fault: {found}.")
        return "\n".join(lines)

    def document(self) -> list[dict[str, Any]]:
        """The rows for JSON."""
        return [
            {
                "fault": m.fault.name,
                "size": m.fault.size,
                "unit": self.unit,
                "size_over_floor": m.fault.size / self.floor,
                "effect": m.effect.name if m.effect else None,
                "found": m.effect.size if m.effect else None,
                "std": m.effect.std if m.effect else None,
            }
            for m in self.matches
        ]

    def _row(self, m: Match, total: float) -> tuple[str, ...]:
        head = (m.fault.name, self._size(m.fault), f"{100 * m.fault.size**2 / total:.2g} %")
        if m.effect is None:
            return (*head, "not found", "-", "-")
        std = quantity(m.effect.std, self.unit) if m.effect.std is not None else "-"
        return (*head, m.effect.name, self._size(m.effect), std)

    def _size(self, curve: Curve) -> str:
        return quantity(curve.size, self.unit)


def hidden_faults(bench: Bench, found: Fit, start: Fit) -> Faults:
    """The faults of a simulated bench beside the effects that `found` has and `start` has not.

    The poses are those of the fit's table, visited once more in a world without noise. Raises what the world raises.
    """
    config = WorldConfig.from_mapping(bench.world)
    poses = _visited(config, bench.seed, found.table)
    faults = [_fault(name, settings, config, bench.seed, found.table, poses) for name, settings in MECHANISMS.items()]
    known = {term.name for term in start.model.terms}
    effects = [_effect(term.name, found, poses) for term in found.model.terms if term.name not in known]
    floor = float(rms(found.noise.floor))
    hidden = sorted((f for f in faults if f is not None and f.size > 0), key=lambda f: -f.size)
    return matched(hidden, effects, floor, poses.unit)


def matched(faults: Sequence[Curve], effects: Sequence[Curve], floor: float, unit: str) -> Faults:
    """Faults and effects in pairs, those with the most similar curves first; an effect belongs to one fault."""
    pairs = [(_correlation(f, e), f, e) for f in faults for e in effects if _alike(f, e)]
    found: dict[str, Curve] = {}
    for _, fault, effect in sorted(pairs, key=lambda pair: -pair[0]):
        if fault.name not in found and effect.name not in {e.name for e in found.values()}:
            found[fault.name] = effect
    used = {effect.name for effect in found.values()}
    matches = tuple(Match(fault, found.get(fault.name)) for fault in faults)
    return Faults(matches, tuple(e for e in effects if e.name not in used), floor, unit)


def _alike(fault: Curve, effect: Curve) -> bool:
    near = effect.size < OF_A_SIZE * fault.size and fault.size < OF_A_SIZE * effect.size
    return near and _correlation(fault, effect) >= ALIKE


def _correlation(a: Curve, b: Curve) -> float:
    length = float(np.linalg.norm(a.curve) * np.linalg.norm(b.curve))
    return float(np.sum(a.curve * b.curve)) / length if length > 0 else 0.0


def _visited(config: WorldConfig, seed: int, table: Table) -> Table:
    """The poses of a table, visited without noise."""
    seen = World(config, seed).dwell_mean(
        table.column("alpha_deg"),
        table.column("beta_deg"),
        direction=table.optional("direction", 1.0),
        mount_deg=table.optional("mount_deg", 0.0),
        flip=table.optional("flip", 0.0),
        noise_free=True,
        interval_s=QUIET_S,
    )
    held = {name: np.asarray(values, float) for name, values in seen.items() if name in table}
    return Table.from_columns(table.kind, held, table.constants, table.source)


def _fault(
    name: str, settings: Sequence[str], config: WorldConfig, seed: int, table: Table, poses: Table
) -> Curve | None:
    """A mechanism's curve; None if the rig does not have it."""
    ideal = WorldConfig.ideal()
    changes = [(path, _value(ideal, path)) for path in settings]
    if all(_value(config, path) == value for path, value in changes):
        return None
    without = config
    for path, value in changes:
        without = without.changed(_nested(path, value))
    return Curve(name, _free(poses, poses.outputs - _visited(without, seed, table).outputs))


def _value(config: Any, path: str) -> float:
    for name in path.split("."):
        config = getattr(config, name)
    return float(config)


def _nested(path: str, value: float) -> dict[str, Any]:
    head, _, rest = path.partition(".")
    return {head: _nested(rest, value) if rest else value}


def _effect(name: str, found: Fit, poses: Table) -> Curve:
    """An effect's curve in the fitted model, and the uncertainty of its size from the fit's covariance."""
    layout = found.problem.layout

    def curve(theta: Array) -> Array:
        steps = layout.steps(theta)
        return _free(poses, forward(poses, steps) - forward(poses, [s for s in steps if s[0].name != name]))

    cov, _ = covariance(found.noise.whiten(found.jacobian), layout.typical)
    std = np.sqrt(np.maximum(np.diag(cov), 0.0))
    size = rms(curve(found.theta).ravel())
    slope = np.zeros(len(found.theta))
    for k in np.flatnonzero(np.isfinite(std) & (std > 0)):
        step = np.zeros_like(found.theta)
        step[k] = STEP_STD * std[k]
        slope[k] = (rms(curve(found.theta + step).ravel()) - size) / step[k]
    used = np.flatnonzero(slope)
    variance = float(slope[used] @ cov[np.ix_(used, used)] @ slope[used])
    return Curve(name, curve(found.theta), float(np.sqrt(max(variance, 0.0))))


def _free(poses: Table, change: Array) -> Array:
    """The change (n, channels) without what bias and scale factor of its channel take up."""
    a = np.radians(poses.column("alpha_deg")), np.radians(poses.column("beta_deg"))
    loads = (np.sin(a[0]) * np.cos(a[1]), np.sin(a[0]) * np.sin(a[1]), np.cos(a[0]))
    return np.column_stack([_off_line(loads[k], change[:, k]) for k in range(change.shape[1])])


def _off_line(load: Array, change: Array) -> Array:
    line = np.column_stack([np.ones_like(load), load])
    return np.asarray(change - line @ np.linalg.lstsq(line, change, rcond=None)[0])
