"""Whether outputs at known poses can be those of the sensor, mounted and wired as stated.

A model fits some parameters to any numbers. These checks need no model: gravity is known, and a sensor responds to it.

no response      an output that is constant, holds noise only, is stuck in many rows, or does not follow gravity
two groups       rows that belong to two sensors: without a pattern in pose or time, and nothing between them
wrong geometry   outputs that follow another axis, mirrored axes, angles that are exchanged or reversed

Tables of poses are checked, and tables of rates whose axes of turn are stated: elsewhere the input is not known.

Source  Wald and Wolfowitz (1940), runs of two kinds of rows; DeSarbo and Cron (1988), regression in two clusters.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from calibrations.criteria import (
    EXCITED_G,
    EXPLAINED_BY_GEOMETRY,
    FAR_BETTER_GEOMETRY,
    FAR_LESS_VARIATION,
    FEWEST_RESPONSE_ROWS,
    FOLLOWS_GRAVITY,
    GROUPS_APART,
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
from calibrations.discovery.readings import other_reading
from calibrations.discovery.verdict import Verdict
from calibrations.fitting.fit import Fit
from calibrations.geometry.orientation import Pose, nominal_pose, specific_force
from calibrations.geometry.rate_table import turn_axes
from calibrations.means.noise import rms, white_std
from calibrations.table import AXES, Array, Table

NO_RESPONSE, UNEXPLAINED, DOUBTFUL = Verdict.NO_RESPONSE.value, Verdict.UNEXPLAINED.value, "doubtful"

ROUNDS = 20  # of a regression in two clusters


@dataclass(frozen=True)
class Finding:
    """One reason not to believe the data as stated. `verdict`: NO_RESPONSE, UNEXPLAINED, or DOUBTFUL (a warning)."""

    verdict: str
    text: str


@dataclass(frozen=True)
class Response:
    """Outputs as linear functions of the specific force: `slope` (axes, 3) in V/g, `share` (axes,) of the variance that
    it explains, `residual` (axes, n) in V."""

    slope: Array
    share: Array
    residual: Array


@lru_cache(maxsize=8)
def findings(table: Table) -> tuple[Finding, ...]:
    """Reasons against a table of poses or rates, worst first; () for other kinds and for healthy data."""
    if table.n < FEWEST_RESPONSE_ROWS:
        return ()
    if table.type.turning:
        return tuple(_of_rates(table))
    if not table.type.stage_angles:
        return ()
    force = specific_force(nominal_pose(table))
    stated, variation = response(table, force), table.outputs.std(axis=0)
    dead = tuple(_dead(table, stated))
    least = V_PER_G[0] * force.std(axis=0).max() if table.unit == "V" else 0.0
    if dead and variation.min() < max(least, FAR_LESS_VARIATION * variation.max()):
        return dead  # no other reading of the angles makes a response of it
    geometry = _geometry(table, stated)
    if geometry is not None and geometry.verdict == UNEXPLAINED:
        return (geometry,)
    if dead:
        return dead
    groups = _two_groups(table)
    return tuple(finding for finding in (groups, geometry) if finding is not None)


def refusal(table: Table) -> Finding | None:
    """The finding that forbids to use the table; None if there is none, or only a warning."""
    return next((finding for finding in findings(table) if finding.verdict != DOUBTFUL), None)


def doubt(table: Table) -> str | None:
    """A warning about a table that can be used; None if there is none."""
    return next((finding.text for finding in findings(table) if finding.verdict == DOUBTFUL), None)


def rejection(fit: Fit) -> Finding | None:
    """The reason not to use the data or the values of a fit; None if they can be used."""
    return refusal(fit.table) or _implausible_zero(fit)


def _implausible_zero(fit: Fit) -> Finding | None:
    """A stage zero that is off by tens of degrees: the cause is a wrong assignment of angles, and no zero."""
    for e in fit.model.estimates("stage-zero-offset"):
        if e.identified and abs(e.value) > TURNED_DEG:
            return Finding(
                UNEXPLAINED,
                f"only a zero of {e.name} that is {e.value:+.3g} deg off would explain these poses, and no stage "
                f"has that; check the column {e.name}_deg, its zero and its sign, and the channels",
            )
    return None


def response(table: Table, a: Array) -> Response:
    """The response to a specific force `a` (n, 3) in g, along the directions in which it changes enough."""
    about = a - a.mean(axis=0)
    U, size, Vt = np.linalg.svd(about, full_matrices=False)
    excited = size > EXCITED_G * np.sqrt(table.n)
    outputs = table.outputs - table.outputs.mean(axis=0)
    part = U[:, excited].T @ outputs
    slope = (Vt[excited].T / size[excited]) @ part
    residual = outputs - U[:, excited] @ part
    total = np.sum(outputs**2, axis=0)
    share = 1 - np.sum(residual**2, axis=0) / np.where(total > 0, total, np.inf)
    return Response(slope.T, np.where(total > 0, share, 0.0), residual.T)


def _dead(table: Table, stated: Response) -> Iterator[Finding]:
    """Outputs that do not respond to gravity, or in some rows only."""
    a = specific_force(nominal_pose(table))
    white = white_std(table)
    for k, name in enumerate(table.output_names):
        if np.std(a[:, k]) < EXCITED_G:
            continue
        floor = None if white is None else float(rms(white[:, k]))
        why = _stuck(table.outputs[:, k], a, name) or _silent(table.outputs[:, k], stated, k, name, floor)
        if why is not None:
            yield Finding(NO_RESPONSE, f"{why}; check the sensor's supply, the cable and the channel of {AXES[k]}")


def _silent(output: Array, stated: Response, k: int, name: str, floor: float | None) -> str | None:
    """The reason against an output that does not respond in any row; None if it responds."""
    swing = float(np.ptp(output))
    if swing <= 1e-9 * float(np.abs(output).max()):
        return f"{name} is constant ({output[0]:.6g} V) while gravity along {AXES[k]} changes"
    share, n = float(stated.share[k]), len(output)
    if share >= FOLLOWS_GRAVITY:
        return None
    spread = float(np.std(output))
    noise = floor is not None and floor > 0 and float(rms(stated.residual[k])) < MOST_SLOW_NOISE * floor
    if noise and fdtrc(3, n - 4, max(share, 0.0) / 3 / ((1 - share) / (n - 4))) < WEAK_RESPONSE:
        return None
    if noise:
        return f"{name} is only noise ({1e3 * spread:.3g} mV rms) while gravity along {AXES[k]} changes"
    return f"{name} does not follow the poses: they explain {share:.0%} of its variation of {1e3 * spread:.3g} mV rms"


def _of_rates(table: Table) -> Iterator[Finding]:
    """The same checks for gyroscopes, which respond to the rate of the table about their own axes."""
    if not (all(f"a{axis}" in table for axis in AXES) or all(f"axis_{axis}" in table for axis in AXES)):
        return
    rate = table.column("rate_deg_s")[:, None] * turn_axes(table)
    about = rate / max(float(np.abs(rate).max()), np.finfo(float).tiny)
    stated = response(table, about)
    turned = [k for k in range(len(table.axes)) if about[:, k].std() > EXCITED_G]
    remedy = "check the columns, the sign of rate_deg_s, and the sensor's mount and cable"
    for k in turned:
        name, share, slope = table.output_names[k], float(stated.share[k]), stated.slope[k]
        if (why := _stuck(table.outputs[:, k], about, name, table.unit, "the rate")) is not None:
            yield Finding(NO_RESPONSE, f"{why}; check the sensor's supply, the cable and the channel of {AXES[k]}")
        elif share < FOLLOWS_GRAVITY:
            yield Finding(
                NO_RESPONSE, f"{name} does not follow the rate, which explains {share:.0%} of its variation; {remedy}"
            )
        elif abs(slope[k]) < np.cos(np.radians(TURNED_DEG)) * np.linalg.norm(slope):
            axis = AXES[int(np.argmax(np.abs(slope)))]
            yield Finding(UNEXPLAINED, f"{name} follows the rate about {axis}, not about {AXES[k]}; {remedy}")
    if (groups := _two_groups(table, about)) is not None:
        yield groups
    if reversed_ := [table.output_names[k] for k in turned if stated.slope[k, k] < 0]:
        yield Finding(
            DOUBTFUL,
            f"{' and '.join(reversed_)} fall{'s' if len(reversed_) == 1 else ''} where the rate rises, as of a table "
            "that turns the other way or an inverted output; rates are positive by the right-hand rule about the "
            "sensor's axis: check the sign of rate_deg_s and of the outputs",
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


def _two_groups(table: Table, about: Array | None = None) -> Finding | None:
    """Rows of two sensors in one table: two linear responses, nothing between them, without a pattern.

    `about` is the known input, shape (n, 3); None for the specific force at the poses.
    """
    if about is None:
        table = table.in_order()
        about = specific_force(nominal_pose(table))
    columns = np.column_stack([np.ones(table.n), about])
    labels, within, distance = _clusters(columns, table.outputs)
    share = float(labels.mean())
    if within > LEFT_WITHIN_GROUPS or not SMALLER_GROUP <= share <= 1 - SMALLER_GROUP or _patterned(table, labels):
        return None
    white = white_std(table)
    axis = int(np.argmax(distance))
    if white is not None and distance[axis] < GROUPS_APART * rms(white[:, axis]):
        return None
    times = "" if white is None else f", {distance[axis] / 2 / float(rms(white[:, axis])):.0f} times the noise floor"
    return Finding(
        UNEXPLAINED,
        f"scatter without a pattern{times}: two groups of rows ({(~labels).sum()} and {labels.sum()}) differ by "
        f"{_distance_text(float(distance[axis]), table.unit)} in {table.axes[axis]}, as if two sensors were in one "
        "table; separate them",
    )


def _distance_text(size: float, unit: str) -> str:
    return f"{1e3 * size:.3g} mV" if unit == "V" else f"{size:.3g} {unit}"


def _clusters(columns: Array, outputs: Array) -> tuple[NDArray[np.bool_], float, Array]:
    """(mask of the second group, share of the residual's variance within groups, distance of the groups by axis).

    The first groups are those by the sign of the residual, for two biases, or by its sign along the output, for two
    scale factors.
    """
    basis = np.linalg.qr(columns)[0]
    residual = outputs - basis @ (basis.T @ outputs)
    size = rms(residual.T)
    if not np.all(size > 0):
        return np.zeros(len(outputs), dtype=bool), 1.0, size
    main = np.linalg.svd(residual / size, full_matrices=False)[0][:, 0]
    along = np.sum(residual / size**2 * (outputs - outputs.mean(axis=0)), axis=1)
    labels, within, distance = min(
        (_refined_clusters(start > 0, columns, outputs / size) for start in (main, along)), key=_within_share
    )
    return labels, within, distance * size


def _refined_clusters(
    labels: NDArray[np.bool_], columns: Array, scaled: Array
) -> tuple[NDArray[np.bool_], float, Array]:
    """The result of `_clusters` for outputs (n, axes) in units of their residual, by iteration from these groups."""
    errors, fitted = np.zeros((2, len(scaled))), np.zeros((2, *scaled.shape))
    for _ in range(ROUNDS):
        for group, rows in enumerate((~labels, labels)):
            if rows.sum() < 2 * columns.shape[1]:
                return labels, 1.0, np.zeros(scaled.shape[1])
            fitted[group] = columns @ np.linalg.lstsq(columns[rows], scaled[rows], rcond=EXCITED_G)[0]
            errors[group] = np.sum((scaled - fitted[group]) ** 2, axis=1)
        after = errors[1] < errors[0]
        if np.array_equal(after, labels):
            break
        labels = after
    within = float(np.mean(np.min(errors, axis=0))) / scaled.shape[1]
    return labels, within, rms((fitted[1] - fitted[0]).T)


def _within_share(clusters: tuple[NDArray[np.bool_], float, Array]) -> float:
    return clusters[1]


def _patterned(table: Table, labels: NDArray[np.bool_]) -> bool:
    """Whether the groups depend on time, direction, path or angle: then they are an effect of the sensor or rig."""
    orders = [np.arange(table.n)]
    orders += [np.argsort(table.column(name), kind="stable") for name in ("temperature_c", "supply_v") if name in table]
    if any(_agreeing(labels, order) > PATTERNED for order in orders):
        return True
    if table.type.turning:
        return _agreeing(labels, np.argsort(table.column("rate_deg_s"), kind="stable")) > PATTERNED
    alpha, beta = table.column("alpha_deg"), table.column("beta_deg")
    if min(_agreeing(labels, *_order_along(beta, alpha)), _agreeing(labels, *_order_along(alpha, beta))) > PATTERNED:
        return True
    kinds = [table.column(name) for name in ("direction", "flip", "mount_deg") if name in table]
    return any(
        sum(max(labels[values == value].sum(), (~labels[values == value]).sum()) for value in np.unique(values))
        > PATTERNED * table.n
        for values in kinds
    )


def _agreeing(labels: NDArray[np.bool_], order: NDArray[np.intp], pairs: NDArray[np.bool_] | None = None) -> float:
    """Share of neighbours in an order that are in one group, of the `pairs` given; 1 if there are no neighbours."""
    agreeing = labels[order][1:] == labels[order][:-1]
    agreeing = agreeing if pairs is None else agreeing[pairs]
    return float(agreeing.mean()) if len(agreeing) else 1.0


def _order_along(angle: Array, fixed_angle: Array) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """(order of the rows by an angle within equal values of the other, mask of neighbours that differ in it alone)."""
    order = np.lexsort((angle, fixed_angle))
    return order, (np.diff(fixed_angle[order]) == 0) & (np.diff(angle[order]) != 0)


def _geometry(table: Table, stated: Response) -> Finding | None:
    """The geometry that explains the outputs better than the stated one; None if there is none."""
    if (reading := other_reading(table, 1 - stated.share)) is not None:
        return Finding(UNEXPLAINED, f"the outputs do not follow the poses as stated; they do if {reading}")
    explained = bool(np.all(stated.share >= EXPLAINED_BY_GEOMETRY))
    assignment = _assignment(table, stated, specific_force(nominal_pose(table))) if explained else None
    if explained and (assignment is None or assignment.verdict == DOUBTFUL):
        return assignment
    angle_readings = " or if ".join(_other_angles(table, stated, explained))
    if assignment is not None:
        return (
            Finding(UNEXPLAINED, f"{assignment.text}; the outputs fit as well if {angle_readings}")
            if angle_readings
            else assignment
        )
    return (
        Finding(UNEXPLAINED, f"the outputs do not follow the poses as stated; they do if {angle_readings}")
        if angle_readings
        else None
    )


def _other_angles(table: Table, stated: Response, explained: bool) -> list[str]:
    """Readings of the angle columns by which each output follows its own axis, unlike by the stated ones."""
    texts = []
    for text, pose in _readings(nominal_pose(table)).items():
        a = specific_force(pose)
        candidate = response(table, a)
        far_better = np.max(1 - candidate.share) <= FAR_BETTER_GEOMETRY * np.max(1 - stated.share)
        if (
            np.all(candidate.share >= EXPLAINED_BY_GEOMETRY)
            and (explained or far_better)
            and _assignment(table, candidate, a) is None
        ):
            texts.append(text)
    return texts


def _readings(pose: Pose) -> Mapping[str, Pose]:
    """Other meanings of the angles, in words."""

    def with_angles(alpha: Array, beta: Array) -> Pose:
        return Pose(alpha, beta, pose.mount, pose.flip, pose.up)

    return MappingProxyType(
        {
            "the columns alpha_deg and beta_deg are exchanged": with_angles(pose.beta, pose.alpha),
            "beta counts backwards (change the sign of beta_deg)": with_angles(pose.alpha, -pose.beta),
            "alpha counts backwards (change the sign of alpha_deg)": with_angles(-pose.alpha, pose.beta),
            "alpha is counted from the horizontal (take 90 - alpha_deg)": with_angles(
                np.pi / 2 - pose.alpha, pose.beta
            ),
            "the angles are in radians": with_angles(np.degrees(pose.alpha), np.degrees(pose.beta)),
        }
    )


def _assignment(table: Table, stated: Response, a: Array) -> Finding | None:
    """Outputs that do not follow their own axes, or follow them backwards; None if there are none."""
    about = a - a.mean(axis=0)
    eigen = np.linalg.eigh(about.T @ about / table.n)
    excited_directions = eigen[1][:, eigen[0] > EXCITED_G**2]
    projector = excited_directions @ excited_directions.T
    excited_axes = projector[: len(stated.slope)]  # excited part of each axis
    size = np.linalg.norm(stated.slope, axis=1)
    if not size.max() > 0:
        return None
    reach = np.linalg.norm(excited_axes, axis=1)
    responding = [k for k in range(len(size)) if stated.share[k] >= FOLLOWS_GRAVITY and size[k] > 0]
    cosine = {k: float(stated.slope[k] @ excited_axes[k] / size[k] / reach[k]) for k in responding if reach[k] > 0.5}
    limit = np.cos(np.radians(TURNED_DEG))
    astray = [k for k, c in cosine.items() if abs(c) < limit]
    astray += [k for k in responding if k not in cosine and size[k] > 0.5 * size.max()]
    if astray:
        return Finding(UNEXPLAINED, _astray(table, stated, astray))
    reversed_ = [k for k, c in cosine.items() if c < 0]
    if not reversed_:
        return None
    names = " and ".join(AXES[k] for k in reversed_)
    if len(reversed_) == len(cosine) or (len(cosine) > 2 and reversed_ == [0, 1]):
        return Finding(
            DOUBTFUL,
            f"the scale factor of {names} is negative, as of a sensor turned by 180 deg on the stage; if it is, state "
            "mount_deg = 180; if not, check the sign of alpha_deg and the wiring",
        )
    return Finding(
        DOUBTFUL,
        f"the scale factor of {names} is negative and that of the others is not, as of a mirrored sensor: beta counts "
        "backwards (change the sign of beta_deg), the sensor is mounted face down (state flip = 1), or the output of "
        f"{names} is inverted",
    )


def _astray(table: Table, stated: Response, rows: list[int]) -> str:
    """The axis that each output follows, and a hint on the wiring to check."""
    follow = []
    for k in rows:
        slope = stated.slope[k]
        axis = int(np.argmax(np.abs(slope)))
        if abs(slope[axis]) > np.cos(np.radians(TURNED_DEG)) * np.linalg.norm(slope):
            follow.append(f"{table.output_names[k]} follows gravity along {'-' if slope[axis] < 0 else ''}{AXES[axis]}")
        else:
            angle = float(np.degrees(np.arctan2(slope[1 - k], slope[k]))) if k < 2 else 0.0
            follow.append(f"{table.output_names[k]} follows gravity {abs(angle):.0f} deg away from {AXES[k]}")
    swapped = len(rows) == 2 and rows == [0, 1] and np.argmax(np.abs(stated.slope[:2]), axis=1).tolist() == [1, 0]
    exchanged = swapped and stated.slope[0, 1] * stated.slope[1, 0] > 0
    remedy = (
        f"the channels are exchanged: exchange the columns {' and '.join(table.output_names[:2])}, or the channels in "
        "the bench file"
        if exchanged
        else "check how the sensor is mounted on the stage (mount_deg) and the assignment of the channels"
    )
    return f"{' and '.join(follow)}; {remedy}"
