"""A run of a magnetometer or a gyroscope as the table that analysis takes.

positions   a magnetometer: a row is the mean of one position; how it was turned is not asked, only that the field stays
rates       a gyroscope: a row is the mean of one turn or rest; the rate is that of the stage, by the right hand about
            the edge that stands along the table's normal (so it is negative while beta grows)

Beside a rate stand the axis of the turn and the specific force in the sensor's frame, as the stages and the mount give
them: axis_x .. axis_z, and ax .. az in g.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from calibrations.table import Array, Table
from procedures.questions import EDGES
from procedures.session import Pose
from rig.errors import RecordError
from rig.record.tables import MOST_BLOCKS, inflations
from rig.record.values import Kept, Run

FIELD, RATE = ("mx", "my", "mz"), ("gx", "gy", "gz")
NOT_OF_THESE = ("filter_corner_hz", "approach_deg")  # constants of a sensor of poses


def positions_table(run: Run, poses: Iterable[Kept]) -> Table:
    """A row for each position of a magnetometer. Raises RecordError where there is none yet."""
    return _table(run, list(poses), FIELD, {})


def rates_table(run: Run, poses: Iterable[Kept]) -> Table:
    """A row for each turn or rest of a gyroscope. Raises RecordError where there is none yet."""
    kept = list(poses)
    normal = np.array([sensor_from_table(each.pose)[:, 2] for each in kept]).reshape(-1, 3)
    force = np.array([specific_force_g(each.pose) for each in kept]).reshape(-1, 3)
    columns = {"rate_deg_s": np.array([-each.pose.rate_deg_s for each in kept]) + 0.0}
    columns |= {f"axis_{axis}": normal[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"a{axis}": force[:, k] for k, axis in enumerate("xyz")}
    return _table(run, kept, RATE, columns)


def sensor_from_table(pose: Pose) -> Array:
    """The mount, shape (3, 3): turned about the table's normal, face down, on edge."""
    c, s = np.cos(np.radians(pose.mount_deg)), np.sin(np.radians(pose.mount_deg))
    face = np.diag([1.0, -1.0, -1.0]) if pose.flip else np.eye(3)
    edge = np.roll(np.eye(3), EDGES.index(pose.up), axis=0)
    return np.asarray(edge @ face @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))


def sensor_from_base(pose: Pose) -> Array:
    """The attitude, shape (3, 3): both stages, then the mount."""
    ca, sa = np.cos(np.radians(pose.alpha_deg)), np.sin(np.radians(pose.alpha_deg))
    cb, sb = np.cos(np.radians(pose.beta_deg)), np.sin(np.radians(pose.beta_deg))
    leaning = np.array([[ca, 0, sa], [0, 1, 0], [-sa, 0, ca]])
    return np.asarray(sensor_from_table(pose) @ np.array([[cb, -sb, 0], [sb, cb, 0], [0, 0, 1]]) @ leaning)


def specific_force_g(pose: Pose) -> Array:
    """In the sensor's frame, shape (3,); of a turn its mean, which is along the table's normal."""
    felt = sensor_from_base(pose)[:, 2]
    along = sensor_from_table(pose)[:, 2]
    return np.round(along * (along @ felt) if pose.rate_deg_s else felt, 12) + 0.0


def _table(run: Run, kept: Sequence[Kept], outputs: Sequence[str], more: Mapping[str, Array]) -> Table:
    if not kept:
        raise RecordError(f"run {run.run} holds no pose yet; `rig resume` goes on with it")
    rows = [each.dwell for each in kept]
    columns = dict(more) | {"t_s": np.array([each.t_s for each in kept])}
    if all(each.temperature_c is not None for each in kept):
        columns["temperature_c"] = np.array([each.temperature_c for each in kept], dtype=float)
    columns |= {name: np.array([row.means[name] for row in rows]) for name in outputs}
    columns |= {f"{name}_std": np.array([row.stds[name] for row in rows]) for name in outputs}
    columns |= {"n": np.array([float(row.n) for row in rows])}
    blocks = [each.samples for each in kept[:: 1 + len(kept) // MOST_BLOCKS]]
    known = {name: value for name, value in run.constants.items() if name not in NOT_OF_THESE}
    constants = {**known, "unit": "V", "sample_rate_hz": blocks[0].rate_hz, **inflations(blocks, outputs)}
    labels = {"path": tuple(each.pose.path for each in kept)}
    table = Table.from_columns(run.kind, columns, constants, run.run, labels)
    return replace(table, numbers=np.array([each.number for each in kept]))
