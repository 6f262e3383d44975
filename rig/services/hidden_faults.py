"""The faults of a simulated rig, compared with the effects that an analysis found: the table at the end of `rig demo`.

A fault is a mechanism of the simulation that the bench file sets. Its size is the rms change of the output without the
mechanism, at the same poses and without noise. The size of an effect is the rms change of the model's output without
the effect. Bias and scale factor are free in both, because every calibration fits them.

Nothing compares the name of an effect with that of a mechanism. A fault belongs to the smallest group of effects
whose values, if changed, give its curve. This data cannot separate faults that share an effect: they are one group, and
its faults together must agree in curve and size with its effects together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import wrap
from typing import Any

import numpy as np

from calibrations.fitting.fit import Fit
from calibrations.fitting.identifiability import covariance
from calibrations.free_forms.place_names import PREFIX, place_of_effect
from calibrations.geometry.stage_path import last_starts
from calibrations.means.noise import rms
from calibrations.model.chain import forward
from calibrations.table import Array, Table
from calibrations.text import columns, quantity
from drivers.world.config import WorldConfig
from drivers.world.visit import Timing
from drivers.world.world import World
from rig.bench import Bench

ALIKE = 0.9  # correlation of a group's faults with its effects
SIZE_RATIO = 3.0  # their sizes differ by this factor at most
LARGEST_REST = 0.3  # of a fault's curve: the largest part that its effects may not describe
WHOLE = 0.1  # of a fault's curve: with a smaller rest, no further effect is taken
MATERIAL = 0.3  # times the noise floor: a smaller fault cannot be seen
STEP_STD = 0.1  # of a parameter, for the derivative of a size
STEP = 1e-3  # of a typical value, for the derivative of a curve
AXES = ("x", "y")
NAMES_WIDTH = 40  # characters of names in a line of the table
QUIET_S = 0.5  # between samples: without noise they are equal, and a few are enough


def _paths_of_axes(part: str, *names: str) -> tuple[str, ...]:
    return tuple(f"sensor.{axis}.{part}.{name}" for axis in AXES for name in names)


# Mechanisms by their names for a technician, with the settings of the simulated world.
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
    "unequal or uneven plates": _paths_of_axes(  # one fault: each of these changes the effect of the others
        "plates", "plate_mismatch_fraction", "overlap_loss_per_um2", "height_step_nm", "stray_fraction"
    ),
    "charge in the oxide": _paths_of_axes("plates", "charging_pm"),
    "springs harden": _paths_of_axes("springs", "hardening_per_um2"),
    "load of the other axis": _paths_of_axes("springs", "foreshortening_per_um"),
    "sag of the mass": _paths_of_axes("springs", "sag_foreshortening_per_um"),
    "package bends as it warms": _paths_of_axes("springs", "stress_pm_per_k"),
    "springs soften as they warm": _paths_of_axes("springs", "stiffening_ppm_per_k"),
    "friction in the springs": _paths_of_axes("friction", "stiffness_fraction"),
    "self-heating": ("heat.board_rise_k", "heat.package_rise_k"),
    "thermal play of the glue": ("heat.glue_play_k",),
    "drift of the supply voltage": ("supply.wander_v",),
}


@dataclass(frozen=True)
class OutputChange:
    """A change of the output, (n, channels), free of bias and scale factor.

    `span`: of an effect, the change of the output by a change of its values, (n, channels, values).
    """

    name: str
    curve: Array
    span: Array | None = None

    @property
    def size(self) -> float:
        """Rms over poses and channels."""
        return float(rms(self.curve.ravel()))


@dataclass(frozen=True)
class Group:
    """Faults that the data cannot separate, and the effects that were found for them; none if they were not found.

    `std`: standard uncertainty of the size of the effects together.
    """

    faults: tuple[OutputChange, ...]
    effects: tuple[OutputChange, ...] = ()
    std: float | None = None

    @property
    def hidden(self) -> float:
        """Size of all faults together."""
        return _sum_curves(self.faults).size

    @property
    def found(self) -> float | None:
        """Size of all effects together."""
        return _sum_curves(self.effects).size if self.effects else None


@dataclass(frozen=True)
class Faults:
    """All groups of faults, the largest first. `extra`: effects that belong to no fault. Sizes in `unit`."""

    groups: tuple[Group, ...]
    extra: tuple[OutputChange, ...]
    floor: float
    unit: str

    @property
    def material(self) -> tuple[Group, ...]:
        """Groups with a fault that is large enough to be seen."""
        return tuple(g for g in self.groups if max(f.size for f in g.faults) >= MATERIAL * self.floor)

    def text(self) -> str:
        """The table hidden / found / uncertainty, and a line for the rest."""
        total = sum(f.size**2 for g in self.groups for f in g.faults) or 1.0
        rows = [row for group in self.material for row in self._rows(group, total)]
        lines = [columns(("hidden fault", "hidden", "share", "found as", "found", "uncertainty"), rows)]
        if small := [f.name for g in self.groups if g not in self.material for f in g.faults]:
            lines.append(f"Too small to be seen, below {MATERIAL:g} noise floors: {', '.join(small)}.")
        if self.extra:
            extra = ", ".join(f"{e.name} ({self._quantity(e.size)})" for e in self.extra)
            lines.append(f"These effects match no hidden fault: {extra}.")
        return "\n".join(lines)

    def document(self) -> list[dict[str, Any]]:
        """The rows for JSON: one for each fault, with the effects of its group."""
        return [
            {
                "fault": fault.name,
                "size": fault.size,
                "unit": self.unit,
                "size_over_floor": fault.size / self.floor,
                "effect": group.effects[0].name if len(group.effects) == 1 else None,
                "effects": [e.name for e in group.effects],
                "together_with": [f.name for f in group.faults if f is not fault],
                "hidden": group.hidden,
                "found": group.found,
                "std": group.std,
            }
            for group in self.groups
            for fault in group.faults
        ]

    def _rows(self, group: Group, total: float) -> list[tuple[str, ...]]:
        """A row for each fault, and one for several together."""
        heads = [(f.name, self._quantity(f.size), f"{100 * f.size**2 / total:.2g} %") for f in group.faults]
        names, *further = wrap(", ".join(e.name for e in group.effects), NAMES_WIDTH) or ["not found"]
        cells = (names, self._quantity(group.found), self._quantity(group.std))
        last = heads[0] if len(heads) == 1 else ("  together", self._quantity(group.hidden), "")
        rows = [(*head, "", "", "") for head in heads[: -1 if len(heads) == 1 else None]]
        return [*rows, (*last, *cells), *(("", "", "", line, "", "") for line in further)]

    def _quantity(self, value: float | None) -> str:
        return quantity(value, self.unit) if value is not None else "-"


def hidden_faults(bench: Bench, fitted: Fit, start: Fit) -> Faults:
    """The faults of a simulated bench, and the effects that only `fitted` has, not `start`.

    The poses are those of the fit's table, simulated once more without noise. Raises the errors of the simulated world.
    """
    config = WorldConfig.from_mapping(bench.world)
    poses = _simulate_poses(config, bench.seed, fitted.table)
    faults = [_fault(name, settings, config, bench.seed, fitted.table, poses) for name, settings in MECHANISMS.items()]
    start_effects = {term.name for term in start.model.terms}
    effects = [_effect(term.name, fitted, poses) for term in fitted.model.terms if term.name not in start_effects]
    floor = float(rms(fitted.noise.floor))
    present_faults = [f for f in faults if f is not None and f.size > 0]
    groups, extra = group_steps(present_faults, effects, floor)
    sized = tuple(replace(g, std=_uncertainty([e.name for e in g.effects], fitted, poses)) for g in groups)
    return Faults(sized, extra, floor, poses.unit)


def group_steps(
    faults: Sequence[OutputChange], effects: Sequence[OutputChange], floor: float
) -> tuple[tuple[Group, ...], tuple[OutputChange, ...]]:
    """The groups, the largest first, and the effects of none. Free forms join the effects at their place."""
    of_catalogue = [e for e in effects if e.span is not None]
    groups: list[Group] = []
    for fault in sorted(faults, key=lambda f: -f.size):
        groups = _join_fault(fault, _makers(fault, of_catalogue, floor), groups, of_catalogue)
    confirmed = [part for group in groups for part in _judge_group(group, effects)]
    used = {e.name for group in confirmed for e in group.effects}
    ordered = tuple(sorted(confirmed, key=lambda g: -max(f.size for f in g.faults)))
    return ordered, tuple(e for e in effects if e.name not in used)


def _join_fault(
    fault: OutputChange, makers: Sequence[OutputChange], groups: Sequence[Group], effects: Sequence[OutputChange]
) -> list[Group]:
    """The groups with one more fault. It merges the groups that have one of its effects."""
    shared = [g for g in groups if any(e in makers for e in g.effects)]
    names = {e.name for e in makers}.union(e.name for g in shared for e in g.effects)
    joined = Group((*(f for g in shared for f in g.faults), fault), tuple(e for e in effects if e.name in names))
    return [*(g for g in groups if g not in shared), joined]


def _makers(fault: OutputChange, effects: Sequence[OutputChange], floor: float) -> list[OutputChange]:
    """The smallest group of effects whose values, if changed, give the curve of a fault; empty if there is none."""
    selected: list[OutputChange] = []
    remaining_size, unseen = fault.size, MATERIAL * floor
    while remaining_size > max(WHOLE * fault.size, unseen):
        remaining = [e for e in effects if e not in selected]
        rests = [_remainder_rms(fault, [*selected, e]) for e in remaining]
        if min(rests, default=remaining_size) > ALIKE * remaining_size:
            break
        remaining_size = min(rests)
        selected.append(remaining[int(np.argmin(rests))])
    return selected if remaining_size <= max(LARGEST_REST * fault.size, unseen) else []


def _remainder_rms(fault: OutputChange, effects: Sequence[OutputChange]) -> float:
    """Rms of the part of a fault's curve that the effects cannot describe."""
    spans = [e.span.reshape(fault.curve.size, -1) for e in effects if e.span is not None]
    columns_ = np.hstack(spans)
    length = np.linalg.norm(columns_, axis=0)
    columns_ = columns_[:, length > 0] / length[length > 0]
    curve = fault.curve.ravel()
    return float(rms(curve - columns_ @ np.linalg.lstsq(columns_, curve, rcond=None)[0]))


def _judge_group(group: Group, effects: Sequence[OutputChange]) -> list[Group]:
    """The group with the free forms of its effects, if its effects agree with its faults; else its faults alone."""
    places = {place_of_effect(e.name) for e in group.effects}
    of_place = [e for e in effects if e.span is None and place_of_effect(e.name) in places]
    extended = replace(group, effects=(*group.effects, *of_place))
    for candidate in (extended, group):
        if candidate.effects and _are_alike(_sum_curves(candidate.faults), _sum_curves(candidate.effects)):
            return [candidate]
    return [Group((fault,)) for fault in group.faults]


def _sum_curves(curves: Sequence[OutputChange]) -> OutputChange:
    return OutputChange(", ".join(c.name for c in curves), np.sum([c.curve for c in curves], axis=0))


def _are_alike(fault: OutputChange, effect: OutputChange) -> bool:
    same_size = effect.size < SIZE_RATIO * fault.size and fault.size < SIZE_RATIO * effect.size
    return same_size and _correlation(fault, effect) >= ALIKE


def _correlation(a: OutputChange, b: OutputChange) -> float:
    length = float(np.linalg.norm(a.curve) * np.linalg.norm(b.curve))
    return float(np.sum(a.curve * b.curve)) / length if length > 0 else 0.0


def _simulate_poses(config: WorldConfig, seed: int, table: Table) -> Table:
    """The poses of a table, visited without noise, each by the last move of beta as in the run.

    Half of the time of a pose passes where this move starts, so that the temperature has the same course.
    """
    direction = table.optional("direction", 1.0)
    columns_visited = World(config, seed).dwell_mean(
        np.repeat(table.column("alpha_deg"), 2),
        np.column_stack([np.degrees(last_starts(table)), table.column("beta_deg")]).ravel(),
        direction=np.repeat(direction, 2),
        mount_deg=np.repeat(table.optional("mount_deg", 0.0), 2),
        flip=np.repeat(table.optional("flip", 0.0), 2),
        noise_free=True,
        interval_s=QUIET_S,
        dwell_s=Timing.dwell_s / 2,
        settle_s=Timing.settle_s / 2,
    )
    columns = {name: np.asarray(values, float)[1::2] for name, values in columns_visited.items() if name in table}
    return Table.from_columns(table.kind, columns, table.constants, table.source)


def _fault(
    name: str, settings: Sequence[str], config: WorldConfig, seed: int, table: Table, poses: Table
) -> OutputChange | None:
    """A mechanism's curve; None if the rig does not have it."""
    ideal = WorldConfig.ideal()
    changes = [(path, _value(ideal, path)) for path in settings]
    if all(_value(config, path) == value for path, value in changes):
        return None
    faultless = config
    for path, value in changes:
        faultless = faultless.changed(_nested_setting(path, value))
    return OutputChange(name, _free(poses, poses.outputs - _simulate_poses(faultless, seed, table).outputs))


def _value(config: Any, path: str) -> float:
    for name in path.split("."):
        config = getattr(config, name)
    return float(config)


def _nested_setting(path: str, value: float) -> dict[str, Any]:
    head, _, tail = path.partition(".")
    return {head: _nested_setting(tail, value) if tail else value}


def _effect(name: str, fitted: Fit, poses: Table) -> OutputChange:
    """An effect's curve in the fitted model; with its span, if it is no free form."""
    curve = _contribution([name], fitted, poses)
    if name.startswith(PREFIX):
        return OutputChange(name, curve(fitted.theta))
    span = []
    for k in np.flatnonzero(fitted.problem.layout.of_effect(name)):
        theta = fitted.theta.copy()
        theta[k] += STEP * fitted.problem.layout.typical[k]
        span.append(curve(theta) - curve(fitted.theta))
    return OutputChange(name, curve(fitted.theta), np.stack(span, axis=2))


def _contribution(names: Sequence[str], fitted: Fit, poses: Table) -> Callable[[Array], Array]:
    """Contribution of effects to the outputs, (n, channels), as a function of the values of all parameters."""
    layout = fitted.problem.layout

    def curve(theta: Array) -> Array:
        steps = layout.steps(theta)
        return _free(poses, forward(poses, steps) - forward(poses, [s for s in steps if s[0].name not in names]))

    return curve


def _uncertainty(names: Sequence[str], fitted: Fit, poses: Table) -> float | None:
    """Standard uncertainty of the size of effects together, from the fit's covariance."""
    if not names:
        return None
    curve = _contribution(names, fitted, poses)
    cov, _ = covariance(fitted.information, fitted.problem.layout.typical)
    std = np.sqrt(np.maximum(np.diag(cov), 0.0))
    size = rms(curve(fitted.theta).ravel())
    slope = np.zeros(len(fitted.theta))
    own_columns = np.any([fitted.problem.layout.of_effect(name) for name in names], axis=0)
    for k in np.flatnonzero(own_columns & np.isfinite(std) & (std > 0)):
        step = np.zeros_like(fitted.theta)
        step[k] = STEP_STD * std[k]
        slope[k] = (rms(curve(fitted.theta + step).ravel()) - size) / step[k]
    used = np.flatnonzero(slope)
    variance = float(slope[used] @ cov[np.ix_(used, used)] @ slope[used])
    return float(np.sqrt(max(variance, 0.0)))


def _free(poses: Table, change: Array) -> Array:
    """The change (n, channels) after a fit of bias and scale factor of each channel."""
    a = np.radians(poses.column("alpha_deg")), np.radians(poses.column("beta_deg"))
    loads = (np.sin(a[0]) * np.cos(a[1]), np.sin(a[0]) * np.sin(a[1]), np.cos(a[0]))
    return np.column_stack([_off_line(loads[k], change[:, k]) for k in range(change.shape[1])])


def _off_line(load: Array, change: Array) -> Array:
    line = np.column_stack([np.ones_like(load), load])
    return np.asarray(change - line @ np.linalg.lstsq(line, change, rcond=None)[0])
