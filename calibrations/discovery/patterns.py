"""Patterns of a residual, whatever their cause: harmonics, steps, ramps, sectors, trends.

Patterns are not effects and explain nothing. They show that the residual has a structure which no effect of the
catalogue explains, describe it in words, and give an expression that adds it to a model.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from calibrations.criteria import FEWEST_LEVELS, PATTERN_BETTER
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.table import Array, Table

HARMONICS = range(2, 13)
OF_ALPHA = range(2, 7)
ROCKING = range(1, 7)  # of alpha, as beta turns
STEPS = 40
RAMPS = 12
FINER_RAMPS = 23
SECTORS = 24
SECTOR_WIDTH_DEG = 30.0
FINER_WIDTHS_DEG = (10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0)
LEVELS = 12  # of a column, that a step could be at
NEIGHBOURS = 200  # of a step, at most, in its refinement
MOST_WAVES = 300  # along the record; at most one in two poses
FINER_WAVES = 21


@dataclass(frozen=True)
class Pattern:
    """Columns, shape (channels, n, k), and their meaning in words.

    `expression` adds the pattern to a model ("" if none can), `finer` gives patterns between it and its neighbours,
    `price` is the cost of its choice by the data, as twice a log-likelihood. A `slow` pattern looks like slow noise,
    unless it is one `sudden` change. `poses` are outlying rows.
    """

    text: str
    columns: Array
    expression: str = ""
    finer: Callable[[], list[Pattern]] = list
    price: float = 0.0
    slow: bool = False
    sudden: bool = False
    poses: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        """The text as the name of an effect."""
        words = re.sub(r"\b(of|the|at|around|t|only)\b", "", self.text.lower())
        return re.sub(r"[^a-z0-9]+", "-", words).strip("-")


FEWEST_ATTITUDES = 3  # of a motion: with two, offsets at either are equivalent

# words for columns and their units, and their short names in expressions
WORDS = {
    "direction": ("direction of turning", "", "direction"),
    "temperature_c": ("temperature", " C", "temperature"),
    "supply_v": ("supply voltage", " V", "supply"),
}


def patterns(table: Table, channels: tuple[str, ...]) -> list[Pattern]:
    """Every pattern that the table's columns can show; rows in order of time."""
    all_patterns = [*_in_time(table), *_in_columns(table)]
    if table.type.stage_angles:
        all_patterns += [*_in_angles(table), *_in_stage(table, len(channels))]
    if table.type.moving:
        all_patterns += [*_in_parts(table, channels), *at_attitudes(table, channels)]
    return [per_channel(p, len(channels)) for p in all_patterns if np.ptp(p.columns) > 0]


def at_attitudes(table: Table, channels: tuple[str, ...]) -> list[Pattern]:
    """An offset of every axis at one attitude of a motion, where there are three attitudes or more."""
    attitudes = np.column_stack([np.round(table.optional(name, 0.0), 1) for name in ("alpha_deg", "beta_deg")])
    distinct = np.unique(attitudes, axis=0)
    means = [c for c, name in enumerate(channels) if name.endswith(" mean")]
    offsets = []
    for alpha, beta in distinct if len(distinct) >= FEWEST_ATTITUDES else ():
        columns = np.zeros((len(channels), table.n, len(means)))
        for k, c in enumerate(means):
            columns[c, :, k] = np.all(attitudes == (alpha, beta), axis=1)
        text = f"an offset at alpha = {alpha:g} deg, beta = {beta:g} deg only"
        offsets.append(Pattern(text, columns, price=2 * float(np.log(len(distinct)))))
    return offsets


def per_channel(pattern: Pattern, channels: int) -> Pattern:
    """The pattern with columns (n, k) repeated for each channel."""
    if pattern.columns.ndim == 3:
        return pattern
    n, k = pattern.columns.shape
    columns = np.zeros((channels, n, k * channels))
    for c in range(channels):
        columns[c, :, c * k : (c + 1) * k] = pattern.columns
    return replace(pattern, columns=columns)


def one_sided(pattern: Pattern, table: Table) -> list[Pattern]:
    """The pattern for one direction of turning only, if the table has both."""
    if "direction" in pattern.text or pattern.poses or pattern.slow:
        return []
    direction = table.optional("direction", 0.0)
    sides = {"clockwise": ">", "anticlockwise": "<"} if np.ptp(direction) > 0 else {}
    sided = []
    for word, sign in sides.items():
        rows = direction > 0 if sign == ">" else direction < 0
        target, plus, formula = pattern.expression.rpartition("+= ")
        expression = f"{target}{plus}(direction {sign} 0)*({formula})" if formula else ""
        columns = pattern.columns * rows[None, :, None]
        sided.append(
            replace(
                pattern,
                text=f"{pattern.text}, turning {word} only",
                columns=columns,
                expression=expression,
                price=PATTERN_BETTER,
            )
        )
    return sided


def _in_time(table: Table) -> Iterator[Pattern]:
    t, has_time = table.time_s, "t_s" in table
    u: Array = (t - t.mean()) / (float(np.ptp(t)) or 1.0)
    trend, expression = ("trend with time", "a*t + b*t**2") if has_time else ("trend from row to row", "")
    yield Pattern(trend, np.column_stack([u, u**2]), expression, slow=True)
    inner = np.unique(np.linspace(2, table.n - 3, min(STEPS, max(table.n - 4, 1))).astype(int))
    for k, rows in zip(inner, _neighbour_ranges(inner, table.n), strict=True):
        yield replace(_step(table, k), finer=partial(_steps, table, rows))
    if has_time:
        starts = np.quantile(t, np.linspace(0, 1, RAMPS + 2))
        for low, start, high in zip(starts[:-2], starts[1:-1], starts[2:], strict=True):
            yield replace(_ramp(t, start), finer=partial(_ramps, t, low, high))
        for waves in np.arange(1.5, min(MOST_WAVES, table.n / 2 - 1), 0.5):
            yield replace(_oscillation(t, waves), finer=partial(_oscillations, t, waves))


def _oscillations(t: Array, waves: float) -> list[Pattern]:
    return [_oscillation(t, waves + part) for part in np.linspace(-0.5, 0.5, FINER_WAVES)]


def _oscillation(t: Array, waves: float) -> Pattern:
    """A number of waves along the record: mains against the sampling clock, a room with intermittent heating."""
    period = (float(np.ptp(t)) or 1.0) / waves
    rate = 2 * np.pi / period
    expression = f"a*sin({rate:.6g}*t) + b*cos({rate:.6g}*t)"
    many = waves >= 100  # so that neighbouring waves have periods of their own
    seconds = f"{period:.4g}" if many else f"{period:.3g}" if period < 100 else f"{period:.0f}"
    return Pattern(
        f"oscillation in time, period {seconds} s", _waves(rate * t), expression, price=PATTERN_BETTER, slow=True
    )


def _ramps(t: Array, low: float, high: float) -> list[Pattern]:
    return [_ramp(t, start) for start in np.linspace(low, high, FINER_RAMPS + 2)[1:-1]]


def _ramp(t: Array, start: float) -> Pattern:
    """0 up to `start`, then a linear rise."""
    rise: Array = np.maximum(0.0, t - start) / (float(np.ptp(t)) or 1.0)
    return Pattern(f"ramp from t = {start:.0f} s on", rise[:, None], f"a*max(0, t - {start:.6g})", slow=True)


def _neighbour_ranges(places: Array, n: int) -> list[Array]:
    """For each of the places among n rows, the rows up to its neighbours."""
    edges = np.concatenate([[1], places, [n - 1]])
    rows = [np.arange(a, b + 1) for a, b in zip(edges[:-2], edges[2:], strict=True)]
    return [span[:: 1 + len(span) // NEIGHBOURS] for span in rows]


def _steps(table: Table, rows: Array) -> list[Pattern]:
    return [_step(table, k) for k in rows]


def _step(table: Table, k: int) -> Pattern:
    """0 before row k, 1 from it on."""
    position = (table.time_s[k - 1] + table.time_s[k]) / 2
    has_time = "t_s" in table
    text = f"step at t = {position:.0f} s" if has_time else f"step at row {position:.0f}"
    expression = f"a*step(t - {position:.7g})" if has_time else ""
    return Pattern(text, np.where(np.arange(table.n) >= k, 1.0, 0.0)[:, None], expression, slow=True, sudden=True)


def _in_columns(table: Table) -> Iterator[Pattern]:
    skip = {"alpha_deg", "beta_deg", "t_s", "n", "flip", "mount_deg", *("ax", "ay", "az", "vx_v", "vy_v", "vz_v")}
    skip.add("displacement_m")
    for name, values in table.columns.items():
        if name in skip or name.endswith(("_std", "_std_v")) or not np.ptp(values):
            continue
        words, unit, short = WORDS.get(name, (name, "", name))
        short = short if short.isidentifier() else ""
        u, levels = (values - values.mean()) / np.ptp(values), np.unique(values)
        curved = len(levels) > 3
        expression = (f"a*{short} + b*{short}**2" if curved else f"a*{short}") if short else ""
        yield Pattern(f"follows {words}", np.column_stack([u, u**2]) if curved else u[:, None], expression)
        if len(levels) >= FEWEST_LEVELS:
            places = np.unique(np.linspace(2, len(levels) - 3, LEVELS).astype(int))
            for k, rows in zip(places, _neighbour_ranges(places, len(levels)), strict=True):
                levelled = partial(_level, values, levels, (words, unit, short))
                yield replace(levelled(k), finer=partial(_levels, levelled, rows))


def _levels(levelled: Callable[[int], Pattern], places: Array) -> list[Pattern]:
    return [levelled(k) for k in places]


def _level(values: Array, levels: Array, words: tuple[str, str, str], k: int) -> Pattern:
    """0 below a level of a column, 1 above it."""
    (word, unit, short), position = words, (levels[k - 1] + levels[k]) / 2
    expression = f"a*step({short} - {position:.7g})" if short else ""
    return Pattern(f"step at {word} = {position:.4g}{unit}", (values >= position)[:, None] * 1.0, expression)


def _in_parts(table: Table, channels: tuple[str, ...]) -> Iterator[Pattern]:
    """A part of the motion with the same error in every stretch."""
    for channel, indicator in zip(channels, np.eye(len(channels)), strict=True):
        yield Pattern(f"{channel} is off throughout", np.tile(indicator[:, None, None], (1, table.n, 1)))


def _in_angles(table: Table) -> Iterator[Pattern]:
    beta = np.radians(table.column("beta_deg"))
    for k in HARMONICS:
        yield Pattern(f"{_ordinal(k)} harmonic of beta", _waves(k * beta), _harmonic(k, "beta"))
    for centre in np.arange(SECTORS) * 360 / SECTORS:
        yield replace(_sector(beta, centre, SECTOR_WIDTH_DEG), finer=partial(_sectors, beta, centre))
    alpha = table.column("alpha_deg")
    values = np.unique(alpha)
    for k in OF_ALPHA:
        if len(values) > 2 * k:
            yield Pattern(f"{_ordinal(k)} harmonic of alpha", _waves(k * np.radians(alpha)), _harmonic(k, "alpha"))
    if 1 < len(values) <= 40:
        for value in values:
            expression = f"a*(abs(alpha_deg - {value:.6g}) < {_half_gap(values):.2g})"
            yield Pattern(f"inclination alpha = {value:g} deg", (alpha == value)[:, None] * 1.0, expression)


def _half_gap(values: Array) -> float:
    return float(np.min(np.diff(values))) / 2


def _sectors(beta: Array, centre: float) -> list[Pattern]:
    step = 360 / SECTORS
    middles = centre + np.linspace(-step, step, 13)
    return [_sector(beta, middle, width) for middle in middles for width in FINER_WIDTHS_DEG]


def _sector(beta: Array, centre_deg: float, width_deg: float) -> Pattern:
    """A bump, 1 in the middle of the sector and 0 outside."""
    centre, edge = np.radians(centre_deg), np.cos(np.radians(width_deg))
    bump = np.maximum(0.0, np.cos(beta - centre) - edge) / (1 - edge)
    expression = f"a*max(0, cos(beta - {centre % (2 * np.pi):.4g}) - {edge:.4g})"
    return Pattern(f"sector of beta around {centre_deg % 360:.0f} deg", bump[:, None], expression)


def _in_stage(table: Table, channels: int) -> Iterator[Pattern]:
    """Errors of a stage angle, which turn gravity in the sensor and so act on all axes together.

    They repeat with the stage's own angle or, if the table rocks while the other stage turns, with beta.
    """
    pose = nominal_pose(table)
    for angle, driver, numbers in (
        ("beta", "beta", HARMONICS),
        ("alpha", "alpha", OF_ALPHA),
        ("alpha", "beta", ROCKING),
    ):
        turned = replace(pose, **{angle: getattr(pose, angle) + 1e-6})
        force_change = ((specific_force(turned) - specific_force(pose)) / 1e-6).T[:channels, :, None]
        degrees = table.column(f"{driver}_deg")
        angle_words = f"the stage angle {angle}" if angle == driver else f"{driver} in the stage angle {angle}"
        for k in numbers:
            if len(np.unique(degrees)) > 2 * k:
                text, waves = f"{_ordinal(k)} harmonic of {angle_words}", _waves(k * np.radians(degrees))
                yield Pattern(text, force_change * waves[None], f"{angle}_deg += {_harmonic(k, driver)}")


def _waves(turned: Array) -> Array:
    return np.column_stack([np.cos(turned), np.sin(turned)])


def _harmonic(k: int, angle: str) -> str:
    return f"a*sin({k}*{angle}) + b*cos({k}*{angle})"


def _ordinal(k: int) -> str:
    return f"{k}{'th' if k > 3 else ('st', 'nd', 'rd')[k - 1]}"
