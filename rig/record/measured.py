"""The measurements of one sensor in a run: poses, readings, and the table for the analysis.

The outputs of a sensor of a batch are channels such as `a1.vx`; without a batch they are `vx`. Channels without the
name of a sensor belong to all sensors.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibrations.table import Array, Table
from calibrations.tables import KINDS
from drivers.errors import did_you_mean
from drivers.recorder import Samples
from procedures.questions import EDGES
from procedures.session import Pose, Reading
from procedures.soak import POWER_ON
from rig.bench import Sensor
from rig.errors import RecordError, UnknownRun
from rig.record import tables
from rig.record.history import interruptions
from rig.record.store import Record
from rig.record.tables import MOST_BLOCKS, inflations, no_poses, poses_table, samples_table, stated_unit, units_of
from rig.record.turns import turn_columns
from rig.record.values import CHANGED, KeptPose, Run

# The table of a magnetometer or a gyroscope.
#
# positions   a magnetometer or an accelerometer: a row is the mean at one position; its attitude is not used; the field
#             must be constant
# rates       a gyroscope: a row is the mean of one turn or rest; the rate of the stage is positive by the right hand
#             about the axis along the table's normal, so it is negative while beta rises
#
# Further columns of rates, from stages and mount: the axis of the turn in the sensor's frame (axis_x .. axis_z) and the
# specific force in g (ax .. az).

FIELD, RATE, FORCE = ("mx", "my", "mz"), ("gx", "gy", "gz"), ("ax", "ay", "az")
POSE_CONSTANTS = ("filter_corner_hz", "approach_deg")  # constants of poses only
PROGRAM_CHANGED = "program_changed"  # a constant: from where on another program or procedure measured
INTERRUPTIONS = "interruptions"  # a constant: when, where and why the run was stopped and resumed


def positions_table(run: Run, poses: Iterable[KeptPose]) -> Table:
    """A row for each position of a magnetometer or an accelerometer. Raises RecordError without one."""
    rows = list(poses)
    outputs = FORCE if rows and FORCE[0] in rows[0].dwell.means else FIELD
    return _table(run, rows, outputs, {})


def rates_table(run: Run, poses: Iterable[KeptPose]) -> Table:
    """A row for each turn or rest of a gyroscope. Raises RecordError without one."""
    turns = list(poses)
    normal = np.array([sensor_from_table(turn.pose)[:, 2] for turn in turns]).reshape(-1, 3)
    force = np.array([specific_force_g(turn.pose) for turn in turns]).reshape(-1, 3)
    columns = {"rate_deg_s": np.array([-turn.pose.rate_deg_s for turn in turns]) + 0.0}
    columns |= {f"axis_{axis}": normal[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"a{axis}": force[:, k] for k, axis in enumerate("xyz")}
    return _table(run, turns, RATE, columns)


def sensor_from_table(pose: Pose) -> Array:
    """The rotation of the mount, shape (3, 3): about the table's normal, face down, on edge."""
    c, s = np.cos(np.radians(pose.mount_deg)), np.sin(np.radians(pose.mount_deg))
    face = np.diag([1.0, -1.0, -1.0]) if pose.flip else np.eye(3)
    edge = np.roll(np.eye(3), EDGES.index(pose.up), axis=0)
    return np.asarray(edge @ face @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))


def sensor_from_base(pose: Pose) -> Array:
    """The attitude of the sensor, shape (3, 3): both stages, then the mount."""
    ca, sa = np.cos(np.radians(pose.alpha_deg)), np.sin(np.radians(pose.alpha_deg))
    cb, sb = np.cos(np.radians(pose.beta_deg)), np.sin(np.radians(pose.beta_deg))
    leaning = np.array([[ca, 0, sa], [0, 1, 0], [-sa, 0, ca]])
    return np.asarray(sensor_from_table(pose) @ np.array([[cb, -sb, 0], [sb, cb, 0], [0, 0, 1]]) @ leaning)


def specific_force_g(pose: Pose) -> Array:
    """Specific force in the sensor's frame, g, shape (3,). In a turn it is the mean, along the table's normal."""
    force = sensor_from_base(pose)[:, 2]
    normal = sensor_from_table(pose)[:, 2]
    return np.round(normal * (normal @ force) if pose.rate_deg_s else force, 12) + 0.0


def _table(run: Run, recorded: Sequence[KeptPose], outputs: Sequence[str], extra_columns: Mapping[str, Array]) -> Table:
    if not recorded:
        raise no_poses(run)
    rows = [pose.dwell for pose in recorded]
    columns = dict(extra_columns) | {"t_s": np.array([pose.t_s for pose in recorded])}
    if all(pose.temperature_c is not None for pose in recorded):
        columns["temperature_c"] = np.array([pose.temperature_c for pose in recorded], dtype=float)
    columns |= {name: np.array([row.means[name] for row in rows]) for name in outputs}
    columns |= {f"{name}_std": np.array([row.stds[name] for row in rows]) for name in outputs}
    columns |= {"n": np.array([float(row.n) for row in rows])}
    blocks = [pose.samples for pose in recorded[:: 1 + len(recorded) // MOST_BLOCKS]]
    constants_kept = {name: value for name, value in run.constants.items() if name not in POSE_CONSTANTS}
    unit = stated_unit(units_of(run, outputs)) or {"unit": "V"}
    constants = {**constants_kept, **unit, "sample_rate_hz": blocks[0].rate_hz, **inflations(blocks, outputs)}
    labels = {"path": tuple(pose.pose.path for pose in recorded)}
    table = Table.from_columns(run.kind, columns, constants, run.run, labels)
    return replace(table, numbers=np.array([pose.number for pose in recorded]))


def turns_table(run: Run, poses: Iterable[KeptPose]) -> Table:
    """Every sample of a gyroscope and an accelerometer in turns between rests. Raises RecordError without a turn."""
    columns = turn_columns(poses, float(run.settings["rest_s"]))
    if not columns:
        raise RecordError(f"run {run.run} has no turn between two rests yet; `rig resume` continues it")
    unit = stated_unit(units_of(run, RATE)) or {"unit": "V"}
    constants = {name: value for name, value in run.constants.items() if name not in POSE_CONSTANTS}
    rate_hz = 1 / float(np.median(np.diff(columns["t_s"])))
    return Table.from_columns(run.kind, columns, {**constants, **unit, "sample_rate_hz": rate_hz}, run.run)


# Tables with a row for each pose or turn; the others have a row for each sample.
ROW_TABLES = {"poses": poses_table, "positions": positions_table, "rates": rates_table, "turns": turns_table}


@dataclass(frozen=True)
class MeasuredRun:
    """A run for the analysis. `sensor` is one sensor of the batch, None without a batch."""

    record: Record
    run: Run
    sensor: str | None = None

    @classmethod
    def named(cls, record: Record, name: str) -> MeasuredRun:
        """`RUN`, or `RUN/SENSOR` of a batch; a name of the sensor that finds the run (`last a1`) chooses it as well.

        Raises UnknownRun; RecordError for a batch without a sensor.
        """
        run_id, slash, sensor = name.partition("/")
        run = record.run(run_id)
        sensor_names = run.batch
        if sensor_names and not slash and not run.run.startswith(run_id):
            last = [
                member for pattern, member in run.sensors.items() if member and f" {run_id}".endswith(f" {pattern}")
            ]
            slash, sensor = ("/", last[0]) if last else ("", "")
        if slash and sensor not in sensor_names:
            listed = did_you_mean(sensor, sensor_names) if sensor_names else f" It has one sensor; write {run_id}."
            raise UnknownRun(f"run {run_id} has no sensor {sensor!r}.{listed}")
        if sensor_names and not slash:
            listed = ", ".join(sensor_names)
            raise RecordError(f"run {run_id} has the sensors {listed}; choose one, such as {run_id}/{sensor_names[0]}")
        return cls(record, run, sensor or None)

    def kept(self) -> Iterator[KeptPose]:
        """Every pose without an exclusion, in order, with the channels of the sensor and the common ones."""
        return (
            of_sensor(recorded, self.sensor) for recorded in self.record.kept(self.run.run) if recorded.excluded is None
        )

    def readings(self) -> Sequence[Reading]:
        """The readings of the run."""
        return self.record.readings(self.run.run)

    @property
    def constants(self) -> Mapping[str, str | float]:
        """The constants of the bench and the sensor, of the displacement sensor in a motion, and remarks on the run."""
        of_run = tables.constants(self.run, self.sensor) if KINDS[self.run.kind].moving else {}
        if changes := [event.text for event in self.record.events(self.run.run) if event.what == CHANGED]:
            of_run[PROGRAM_CHANGED] = "; ".join(changes)  # also in every export
        if stops := interruptions(self.record, self.run.run):
            of_run[INTERRUPTIONS] = stops
        if self.sensor is None:
            return {**self.run.constants, **of_run}
        sensor = Sensor.model_validate(self.run.bench["sensors"][self.sensor])
        return {**self.run.constants, **sensor.constants, **of_run}

    def table(self) -> Table:
        """A row for each pose or, in a run of another kind, for each sample. Raises RecordError without a row."""
        return self.part(self.run.kind) if (imported := self.imported()) is None else self._included_rows(imported)

    def imported(self) -> Table | None:
        """The table as it was imported, with the excluded rows; None for a measured run."""
        numbers, labels = self.record.columns(self.run.run)
        if not numbers:
            return None
        return Table.from_columns(self.run.kind, numbers, self.run.constants, self.run.run, labels)

    def _included_rows(self, table: Table) -> Table:
        """The rows without an exclusion. They keep their numbers. Raises RecordError without any."""
        excluded = list(self.record.excluded(self.run.run))
        if not excluded:
            return table
        if len(excluded) == table.n:
            raise RecordError(
                f"run {self.run.run}: all {table.n} rows are excluded; include one again, as with "
                f"`rig exclude {self.run.run} {excluded[0]} --include`"
            )
        return table.rows(~np.isin(np.arange(table.n), excluded))

    def part(self, kind: str, path: str = "") -> Table:
        """A table of `kind` from the poses whose path begins with `path`. Raises RecordError."""
        run = replace(self.run, run=self.name, constants=self.constants, kind=kind)
        on_s = self.power_on_s()
        poses = (
            replace(recorded, t_s=recorded.t_s - on_s)
            for recorded in self.kept()
            if recorded.pose.path.startswith(path)
        )
        return ROW_TABLES.get(kind, samples_table)(run, poses)

    def power_on_s(self) -> float:
        """The time on the run's clock when the run switched the sensor on; 0 if it did not.

        The reading is on the clock of the bench, and the same process took it before the first pose.
        """
        read_s = next((reading.value for reading in self.readings() if reading.name == POWER_ON), None)
        first = next(self.record.kept(self.run.run), None)
        if read_s is None or first is None:
            return 0.0
        middle_s = first.samples.start_s + len(first.samples.volts) / first.samples.rate_hz / 2
        return first.t_s - (middle_s - read_s)

    @property
    def name(self) -> str:
        """RUN or RUN/SENSOR."""
        return self.run.run if self.sensor is None else f"{self.run.run}/{self.sensor}"


def table_of(record: Record, name: str) -> Table:
    """The table of a measured or imported run, see `MeasuredRun`."""
    return MeasuredRun.named(record, name).table()


def of_sensor(recorded: KeptPose, sensor: str | None) -> KeptPose:
    """A pose with the channels of one sensor, without its name in them, and the common channels."""
    if sensor is None:
        return recorded
    samples = recorded.samples
    names = {name.removeprefix(f"{sensor}."): k for k, name in enumerate(samples.channels)}
    own_channels = {name: k for name, k in names.items() if "." not in name}
    volts = samples.volts[:, list(own_channels.values())]
    return replace(recorded, samples=Samples(volts, tuple(own_channels), samples.rate_hz, samples.start_s))
