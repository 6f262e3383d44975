"""Whether outputs at known poses can be those of the sensor, mounted and wired as stated.

A model fits some parameters to any numbers. These checks need no model: gravity is known, and a sensor responds to it.

no response      an output that is constant, holds noise only, is stuck in many rows, or does not follow gravity
two groups       rows that belong to two sensors: without a pattern in pose or time, and nothing between them
wrong geometry   outputs that follow the poses in another reading of the table (`readings.py`)

Tables of poses are checked, and tables of rates whose axes of turn are stated: elsewhere the input is not known. Where
its magnitude alone is known, an axis that does not respond shows in the other axes.

Source  Wald and Wolfowitz (1940), runs of two kinds of rows; DeSarbo and Cron (1988), regression in two clusters.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from calibrations.criteria import (
    EXCITED_G,
    EXPLAINED_BY_GEOMETRY,
    FAR_LESS_VARIATION,
    FEWEST_RESPONSE_ROWS,
    FOLLOWS_GRAVITY,
    GROUPS_APART,
    LARGEST_MISFIT,
    LEAST_ASIDE,
    LEAST_OTHER_SIDE,
    LEFT_WITHIN_GROUPS,
    MOST_SLOW_NOISE,
    PATTERNED,
    SMALLER_GROUP,
    STUCK_CHANGE,
    STUCK_ROWS,
    TURNED_DEG,
    V_PER_G,
    WEAK_RESPONSE,
)
from calibrations.discovery.readings import Response, geometry_finding, response
from calibrations.discovery.verdict import Finding, Verdict
from calibrations.fitting.fit import Fit
from calibrations.geometry.orientation import reported_force
from calibrations.geometry.rate_table import turn_axes
from calibrations.means.noise import rms, white_std
from calibrations.table import AXES, Array, Table
from calibrations.text import quantity

ROUNDS = 20  # of a regression in two clusters
# Of the rows, those at which the groups differ by so many times what they leave: an effect of a few poses divides the
# other rows by their noise.
APART_ROWS, CLEARLY_APART = 0.5, 3.0
MOST_SHARED = 3  # rows for each column of the effects that two sensors share: fewer rows would be fitted themselves
LEAST_REPEATED = 0.25  # pairs of rows of one force, of the rows: of fewer, chance makes most agree
CHECK_WIRING = "check the sensor's supply, the cable and the channel of"


@lru_cache(maxsize=8)
def findings(table: Table) -> tuple[Finding, ...]:
    """Reasons against a table of poses or rates, worst first; () for other kinds and for healthy data."""
    if table.n < FEWEST_RESPONSE_ROWS:
        return ()
    if table.type.magnitude:
        return tuple(_of_magnitudes(table))
    if table.type.turning and table.type.known_input:
        return tuple(_of_rates(table))
    if not table.type.stage_angles:
        return ()
    force = reported_force(table)
    stated_response, variation = response(table.outputs, force), table.outputs.std(axis=0)
    dead_outputs = tuple(_unresponsive_outputs(table, stated_response))
    least = V_PER_G[0] * force.std(axis=0).max() if table.unit == "V" else 0.0
    if dead_outputs and variation.min() < max(least, FAR_LESS_VARIATION * variation.max()):
        return dead_outputs  # no other reading of the angles makes a response of it
    geometry = geometry_finding(table, stated_response)
    if geometry is not None and geometry.verdict is not None:
        return (geometry,)
    if dead_outputs:
        return dead_outputs
    groups = _two_groups(table)
    return tuple(finding for finding in (groups, geometry) if finding is not None)


def refusal(table: Table) -> Finding | None:
    """The finding that forbids to use the table; None if there is none, or only a warning."""
    return next((finding for finding in findings(table) if finding.verdict is not None), None)


def doubt(table: Table) -> str | None:
    """A warning about a table that can be used; None if there is none."""
    return next((finding.text for finding in findings(table) if finding.verdict is None), None)


def rejection(fit: Fit) -> Finding | None:
    """The reason not to use the data or the values of a fit; None if they can be used."""
    return refusal(fit.table) or _implausible_zero(fit)


def _implausible_zero(fit: Fit) -> Finding | None:
    """A stage zero that is off by tens of degrees: the cause is a wrong assignment of angles, and no zero."""
    for e in fit.model.estimates("stage-zero-offset"):
        if e.identified and abs(e.value) > TURNED_DEG:
            return Finding(
                Verdict.UNEXPLAINED,
                f"only a zero of {e.name} that is {e.value:+.3g} deg off would explain these poses, and no stage "
                f"has that; check the column {e.name}_deg, its zero and its sign, and the channels",
            )
    return None


def _unresponsive_outputs(table: Table, stated_response: Response) -> Iterator[Finding]:
    """Outputs that do not respond to gravity, or in some rows only."""
    a = reported_force(table)
    white = white_std(table)
    for k, name in enumerate(table.output_names):
        if np.std(a[:, k]) < EXCITED_G:
            continue
        floor = None if white is None else float(rms(white[:, k]))
        reason = _stuck(table.outputs[:, k], a, name) or _silent(table.outputs[:, k], stated_response, k, name, floor)
        if reason is not None:
            yield Finding(Verdict.NO_RESPONSE, f"{reason}; {CHECK_WIRING} {AXES[k]}")


def _silent(output: Array, stated_response: Response, k: int, name: str, floor: float | None) -> str | None:
    """The reason against an output that does not respond in any row; None if it responds."""
    swing = float(np.ptp(output))
    if swing <= 1e-9 * float(np.abs(output).max()):
        return f"{name} is constant ({output[0]:.6g} V) while gravity along {AXES[k]} changes"
    share, n = float(stated_response.share[k]), len(output)
    if share >= FOLLOWS_GRAVITY:
        return None
    spread = float(np.std(output))
    noise = floor is not None and floor > 0 and float(rms(stated_response.residual[k])) < MOST_SLOW_NOISE * floor
    if noise and fdtrc(3, n - 4, max(share, 0.0) / 3 / ((1 - share) / (n - 4))) < WEAK_RESPONSE:
        return None
    if noise:
        return f"{name} is only noise ({quantity(spread, 'V')} rms) while gravity along {AXES[k]} changes"
    return f"{name} does not follow the poses: they explain {share:.0%} of its variation of {quantity(spread, 'V')} rms"


def _of_rates(table: Table) -> Iterator[Finding]:
    """The same checks for gyroscopes, which respond to the rate of the table about their own axes."""
    if not (all(f"a{axis}" in table for axis in AXES) or all(f"axis_{axis}" in table for axis in AXES)):
        return
    rate = table.column("rate_deg_s")[:, None] * turn_axes(table)
    relative_rate = rate / max(float(np.abs(rate).max()), np.finfo(float).tiny)
    stated_response = response(table.outputs, relative_rate)
    turned = [k for k in range(len(table.axes)) if relative_rate[:, k].std() > EXCITED_G]
    remedy = "check the columns, the sign of rate_deg_s, and the sensor's mount and cable"
    for k in turned:
        name, share, slope = table.output_names[k], float(stated_response.share[k]), stated_response.slope[k]
        if (reason := _stuck(table.outputs[:, k], relative_rate, name, table.unit, "the rate")) is not None:
            yield Finding(Verdict.NO_RESPONSE, f"{reason}; {CHECK_WIRING} {AXES[k]}")
        elif share < FOLLOWS_GRAVITY:
            yield Finding(
                Verdict.NO_RESPONSE,
                f"{name} does not follow the rate, which explains {share:.0%} of its variation; {remedy}",
            )
        elif abs(slope[k]) < np.cos(np.radians(TURNED_DEG)) * np.linalg.norm(slope):
            axis = AXES[int(np.argmax(np.abs(slope)))]
            yield Finding(Verdict.UNEXPLAINED, f"{name} follows the rate about {axis}, not about {AXES[k]}; {remedy}")
    if (groups := _two_groups(table, relative_rate)) is not None:
        yield groups
    if reversed_ := [table.output_names[k] for k in turned if stated_response.slope[k, k] < 0]:
        yield Finding(
            None,
            f"{' and '.join(reversed_)} fall{'s' if len(reversed_) == 1 else ''} when the rate rises: the table turns "
            "the other way, or the output is inverted; rates are positive by the right-hand rule about the sensor's "
            "axis: check the sign of rate_deg_s and of the outputs",
        )


def _of_magnitudes(table: Table) -> Iterator[Finding]:
    """An axis that hardly changes is not excited if the magnitude of the others is constant, and dead if it is not."""
    outputs, spread = table.outputs, table.outputs.std(axis=0)
    for k, name in enumerate(table.output_names):
        others = np.delete(outputs, k, axis=1)
        if spread[k] > FAR_LESS_VARIATION * spread.max() or others.shape[1] < 2:
            continue
        u, v = ((others - others.mean(axis=0)) / spread.max()).T
        columns = np.column_stack([u * u, u * v, v * v, u, v])
        coefficients = np.linalg.lstsq(columns, np.ones(table.n), rcond=None)[0]
        if np.std(columns @ coefficients) > LARGEST_MISFIT:
            yield Finding(
                Verdict.NO_RESPONSE,
                f"{name} changes by only {spread[k]:.2g} {table.unit} rms, and the other axes show that the sensor "
                f"turns about more than this axis; {CHECK_WIRING} {AXES[k]}",
            )


def _stuck(output: Array, a: Array, name: str, unit: str = "V", input_name: str = "gravity") -> str | None:
    """The reason against an output that responds in some rows only; None if it responds in all."""
    n, count = len(output), max(FEWEST_RESPONSE_ROWS, int(STUCK_ROWS * len(output)))
    order = np.sort(output)
    if count >= n or not np.ptp(output):
        return None
    widths = order[count - 1 :] - order[: n - count + 1]
    start = int(np.argmin(widths))
    value, width = float(np.median(order[start : start + count])), float(widths[start])
    rows = np.abs(output - value) <= max(2 * width, 1e-9 * abs(value))
    responding = ~rows
    if responding.sum() < FEWEST_RESPONSE_ROWS:
        return None
    columns = np.column_stack([np.ones(n), a])
    coefficients, _, rank, _ = np.linalg.lstsq(columns[responding], output[responding], rcond=EXCITED_G)
    expected = columns @ coefficients
    remainder = output[responding] - expected[responding]
    if rank < 2 or np.var(remainder) > (1 - EXPLAINED_BY_GEOMETRY) * np.var(output[responding]):
        return None
    if np.std(output[rows]) > STUCK_CHANGE * np.std(expected[rows]):
        return None
    deviation = expected[rows] - value
    margin = LEAST_ASIDE * float(np.ptp(expected))
    if min(np.mean(deviation > margin), np.mean(deviation < -margin)) < LEAST_OTHER_SIDE:
        return None
    return f"{name} is stuck at {value:.5g} {unit} in {rows.sum()} of {n} rows while {input_name} changes"


def _two_groups(table: Table, known_input: Array | None = None) -> Finding | None:
    """Rows of two sensors in one table: two linear responses, nothing between them, without a pattern.

    `known_input` is the known input, shape (n, 3); None for the specific force at the poses.
    """
    if known_input is None:
        table = table.in_order()
        known_input = reported_force(table)
    columns = np.column_stack([np.ones(table.n), known_input])
    labels, within_share, distance = _clusters(columns, table.outputs)
    if within_share > LEFT_WITHIN_GROUPS:  # effects that both sensors have may hide the groups
        shared = _smooth_effects(table, known_input)
        if table.n > MOST_SHARED * shared.shape[1]:
            labels, within_share, distance = _clusters(columns, table.outputs, shared)
    share = float(labels.mean())
    if (
        within_share > LEFT_WITHIN_GROUPS
        or not SMALLER_GROUP <= share <= 1 - SMALLER_GROUP
        or _has_pattern(table, labels)
    ):
        return None
    white = white_std(table)
    axis = int(np.argmax(distance))
    if white is not None and distance[axis] < GROUPS_APART * rms(white[:, axis]):
        return None
    times = "" if white is None else f", {distance[axis] / 2 / float(rms(white[:, axis])):.0f} times the noise floor"
    return Finding(
        Verdict.UNEXPLAINED,
        f"scatter without a pattern{times}: two groups of rows ({(~labels).sum()} and {labels.sum()}) differ by "
        f"{_distance_text(float(distance[axis]), table.unit)} in {table.axes[axis]}, as if two sensors were in one "
        "table; separate them",
    )


def _smooth_effects(table: Table, known_input: Array) -> Array:
    """Smooth effects of a sensor, (n, columns): a cubic in the input, and the input by direction, time and temperature.

    Unlike two groups of rows, none of them changes from one row to the next.
    """
    x = np.column_stack([np.ones(table.n), known_input / max(float(np.abs(known_input).max()), np.finfo(float).tiny)])
    linear, square = x.T, [x[:, i] * x[:, k] for i in range(4) for k in range(i, 4)]
    cubes = [part * x[:, k] for part in square for k in range(1, 4)]
    names = ("direction", "t_s", "temperature_c", "supply_v", "mount_deg", "flip")
    changing = [c for c in (table.column(name) for name in names if name in table) if np.ptp(c) > 0]
    by_column = [part * (c - c.mean()) / c.std() for c in changing for part in linear]
    columns = np.column_stack([*square, *cubes, *by_column])
    return np.asarray(columns / np.linalg.norm(columns, axis=0).clip(np.finfo(float).tiny))


def _distance_text(size: float, unit: str) -> str:
    return f"{1e3 * size:.3g} mV" if unit == "V" else f"{size:.3g} {unit}"


def _clusters(columns: Array, outputs: Array, shared: Array | None = None) -> tuple[NDArray[np.bool_], float, Array]:
    """(mask of the second group, share of the residual's variance within groups, distance of the groups by axis).

    Both groups have their own response to `columns` and the same to `shared`. The first groups are those by the sign
    of the residual, for two biases, or by its sign along the output, for two scale factors.
    """
    basis = np.linalg.svd(columns if shared is None else shared, full_matrices=False)[0]
    residual = outputs - basis @ (basis.T @ outputs)
    size = rms(residual.T)
    if not np.all(size > 0):
        return np.zeros(len(outputs), dtype=bool), 1.0, size
    main = np.linalg.svd(residual / size, full_matrices=False)[0][:, 0]
    along_output = np.sum(residual / size**2 * (outputs - outputs.mean(axis=0)), axis=1)
    labels, within_share, distance = min(
        (_refine_clusters(start > 0, columns, residual / size, basis) for start in (main, along_output)),
        key=_variance_within_clusters,
    )
    return labels, within_share, distance * size


def _refine_clusters(
    labels: NDArray[np.bool_], columns: Array, scaled: Array, basis: Array
) -> tuple[NDArray[np.bool_], float, Array]:
    """The result of `_clusters` for residuals (n, axes) in units of their rms, by iteration from these groups.

    The residuals are orthogonal to the `basis` of what both groups share.
    """
    errors, difference = np.zeros((2, len(scaled))), np.zeros_like(scaled)
    for _ in range(ROUNDS):
        if min(labels.sum(), (~labels).sum()) < 2 * columns.shape[1]:
            return labels, 1.0, np.zeros(scaled.shape[1])
        own = columns * labels[:, None]
        beyond = own - basis @ (basis.T @ own)
        slope = np.linalg.lstsq(beyond, scaled, rcond=EXCITED_G)[0]
        difference = columns @ slope
        shared = basis @ (basis.T @ (own @ slope))
        errors = np.array([np.sum((scaled + shared - group) ** 2, axis=1) for group in (0 * difference, difference)])
        updated = errors[1] < errors[0]
        if np.array_equal(updated, labels):
            break
        labels = updated
    within_share = float(np.mean(np.min(errors, axis=0))) / scaled.shape[1]
    within = np.sqrt(within_share * scaled.shape[1])
    if np.mean(np.linalg.norm(difference, axis=1) > CLEARLY_APART * within) < APART_ROWS:
        within_share = 1.0
    return labels, within_share, rms(difference.T)


def _variance_within_clusters(clusters: tuple[NDArray[np.bool_], float, Array]) -> float:
    return clusters[1]


def _has_pattern(table: Table, labels: NDArray[np.bool_]) -> bool:
    """Whether the groups depend on time, direction, path, angle or pose: then an effect of sensor or rig made them."""
    share = float(labels.mean())
    by_chance = share**2 + (1 - share) ** 2  # neighbours in one group, where the groups are mixed at random
    orders = [np.arange(table.n)]
    orders += [np.argsort(table.column(name), kind="stable") for name in ("temperature_c", "supply_v") if name in table]
    if any(_exceeds_chance(_share_of_agreement(labels, order), by_chance) for order in orders):
        return True
    if table.type.turning:
        return _exceeds_chance(
            _share_of_agreement(labels, np.argsort(table.column("rate_deg_s"), kind="stable")), by_chance
        )
    alpha, beta = table.column("alpha_deg"), table.column("beta_deg")
    along = min(
        _share_of_agreement(labels, *_order_along(beta, alpha)), _share_of_agreement(labels, *_order_along(alpha, beta))
    )
    if _exceeds_chance(along, by_chance) or _follow_orientation(labels, reported_force(table), by_chance):
        return True
    kinds = [table.column(name) for name in ("direction", "flip", "mount_deg") if name in table]
    return any(
        _exceeds_chance(
            sum(max(labels[values == value].sum(), (~labels[values == value]).sum()) for value in np.unique(values))
            / table.n,
            max(share, 1 - share),
        )
        for values in kinds
    )


def _follow_orientation(labels: NDArray[np.bool_], force: Array, by_chance: float) -> bool:
    """Whether rows of one specific force (n, 3) are in one group: an effect made them, and two sensors have both."""
    same = np.unique(np.round(force, 3), axis=0, return_inverse=True)[1].ravel()
    rows, second = np.bincount(same), np.bincount(same, labels)
    pairs = float(np.sum(rows * (rows - 1))) / 2
    if pairs < len(labels) * LEAST_REPEATED:
        return False
    agreeing = float(np.sum(second * (second - 1) + (rows - second) * (rows - second - 1))) / 2
    return _exceeds_chance(agreeing / pairs, by_chance)


def _exceeds_chance(agreement: float, by_chance: float) -> bool:
    """Whether rows agree in their group by far more than two groups of this size that are mixed at random."""
    return agreement - by_chance > PATTERNED * (1 - by_chance)


def _share_of_agreement(
    labels: NDArray[np.bool_], order: NDArray[np.intp], pairs: NDArray[np.bool_] | None = None
) -> float:
    """Share of neighbours in an order that are in one group, of the `pairs` given; 1 if there are no neighbours."""
    agreeing = labels[order][1:] == labels[order][:-1]
    agreeing = agreeing if pairs is None else agreeing[pairs]
    return float(agreeing.mean()) if len(agreeing) else 1.0


def _order_along(angle: Array, fixed_angle: Array) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """(order of the rows by an angle within equal values of the other, mask of neighbours that differ in it alone)."""
    order = np.lexsort((angle, fixed_angle))
    return order, (np.diff(fixed_angle[order]) == 0) & (np.diff(angle[order]) != 0)
