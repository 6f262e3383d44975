"""What a run measured of one sensor: its poses and readings, and the table that analysis takes.

The outputs of a batch's sensor are channels such as `a1.vx`; of one sensor they are plainly `vx`. Channels without a
sensor's name belong to all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from calibrations.table import Table
from procedures.session import Reading
from procedures.soak import POWER_ON
from rig.bench import Sensor
from rig.errors import RecordError, UnknownRun
from rig.nearest import did_you_mean
from rig.record import displacement
from rig.record.raw import samples_table
from rig.record.store import Record
from rig.record.tables import poses_table
from rig.record.turned import positions_table, rates_table
from rig.record.values import Block, Kept, Run

# Tables of which a row is a pose or a turn; of the others it is a sample.
MADE = {"poses": poses_table, "positions": positions_table, "rates": rates_table}


@dataclass(frozen=True)
class Measured:
    """A run as analysis sees it. `sensor` is one of the run's batch, None where it has only one."""

    record: Record
    run: Run
    sensor: str | None = None

    @classmethod
    def named(cls, record: Record, name: str) -> Measured:
        """`RUN`, or `RUN/SENSOR` of a batch. Raises UnknownRun; RecordError where none of a batch is named."""
        run_id, slash, sensor = name.partition("/")
        run = record.run(run_id)
        known = sensors_of(run)
        if slash and sensor not in known:
            listed = did_you_mean(sensor, known) if known else " It has one sensor: leave out the slash."
            raise UnknownRun(f"run {run_id} has no sensor {sensor!r}.{listed}")
        if known and not slash:
            listed = ", ".join(known)
            raise RecordError(f"run {run_id} holds the sensors {listed}; name one, such as {run_id}/{known[0]}")
        return cls(record, run, sensor or None)

    def kept(self) -> Iterator[Kept]:
        """Every pose that is not excluded, in order, with the sensor's own channels and the common ones."""
        return (of_sensor(kept, self.sensor) for kept in self.record.kept(self.run.run) if kept.excluded is None)

    def readings(self) -> Sequence[Reading]:
        """Numbers that belong to the run."""
        return self.record.readings(self.run.run)

    @property
    def constants(self) -> Mapping[str, str | float]:
        """What is known of the sensor, beside what holds for the bench."""
        shaken = displacement.constants(self.run, self.sensor) if self.run.kind == "motion" else {}
        if self.sensor is None:
            return {**self.run.constants, **shaken}
        sensor = Sensor.model_validate(self.run.bench["sensors"][self.sensor])
        return {**self.run.constants, **sensor.constants, **shaken}

    def table(self) -> Table:
        """A row for each pose or, in a run of another kind, for each sample. Raises RecordError where there is none."""
        numbers, labels = self.record.columns(self.run.run)
        if numbers:
            return Table.from_columns(self.run.kind, numbers, self.run.constants, self.run.run, labels)
        return self.part(self.run.kind)

    def part(self, kind: str, path: str = "") -> Table:
        """A table of another kind out of the run: of `poses` whose path begins with `path`. Raises RecordError."""
        run = replace(self.run, run=self.name, constants=self.constants, kind=kind)
        on_s = self.power_on_s()
        poses = (replace(kept, t_s=kept.t_s - on_s) for kept in self.kept() if kept.pose.path.startswith(path))
        return MADE.get(kind, samples_table)(run, poses)

    def power_on_s(self) -> float:
        """When the run itself switched the sensor on, on its clock: 0 where it did not.

        The reading is the bench's, and was taken before the first pose by the same process.
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
    """The table of a run, measured or imported: see `Measured`."""
    return Measured.named(record, name).table()


def sensors_of(run: Run) -> list[str]:
    """The sensors of the run's batch, in order; none where it has one."""
    return list(run.bench.get("sensors", {}))


def of_sensor(kept: Kept, sensor: str | None) -> Kept:
    """A pose with the channels of one sensor under their plain names, and the common ones."""
    if sensor is None:
        return kept
    samples = kept.samples
    names = {name.removeprefix(f"{sensor}."): k for k, name in enumerate(samples.channels)}
    mine = {name: k for name, k in names.items() if "." not in name}
    block = Block(samples.volts[:, list(mine.values())], tuple(mine), samples.rate_hz, samples.start_s)
    return replace(kept, samples=block)
