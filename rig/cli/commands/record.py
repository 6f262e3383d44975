"""show, exclude and export: one run of the record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from calibrations.errors import CalibrationError
from calibrations.tables import MEANS
from calibrations.text import columns, duration
from rig.bench.certificates import EXPIRED
from rig.cli.terminal.complete import complete_data, complete_run
from rig.cli.terminal.output import emit, json_option, note, out_option
from rig.cli.terminal.progress import working
from rig.errors import RecordError
from rig.record import Event, KeptPose, LogLine, Record, Run
from rig.record.codec import digest_of
from rig.record.history import history
from rig.record.measured import MeasuredRun
from rig.record.tables import units_of
from rig.services.next_steps import next_steps, results_table

Ranges = Mapping[str, tuple[float, float]]


@click.command("show")
@click.argument("run", shell_complete=complete_run)
@click.option("--poses", is_flag=True, help="List every pose with its number, and the reason if it is excluded.")
@click.option("--log", "wants_log", is_flag=True, help="List the log: every step with its time.")
@json_option
def show_command(run: str, poses: bool, wants_log: bool, as_json: bool) -> None:
    """Show the settings, events and results of RUN, and the range of each column."""
    from rig.services.history import calibration_counts  # loads the fit

    with working(f"reading {run}"), Record.to_find(run) as record:
        run_row = record.run(run)
        run = run_row.run
        left_out = record.excluded(run)
        events = history(record, run)
        ranges = _ranges(record, run_row)
        listed = _poses(record, run_row) if poses else None
        lines = record.lines(run) if wants_log else []
        run_counts = calibration_counts(run_row, record.runs())
    if as_json:
        details = ({"kept": listed} if poses else {}) | ({"log": [vars(line) for line in lines]} if wants_log else {})
        emit(_run_document(run_row, events, ranges) | details)
    else:
        result_lines = [*results_table(run_row.results), *next_steps(run_row, left_out)]
        result_lines += [
            f"The record has {count} calibration runs of the sensor {name}: rig history {name}"
            for name, count in run_counts.items()
        ]
        parts = (
            _head(run_row),
            result_lines,
            _columns(ranges),
            [_event(event, run_row.message) for event in events],
            _tabulate_poses(listed or []),
            _iterate_log(lines),
        )
        click.echo("\n\n".join("\n".join(part) for part in parts if part))


def _ranges(record: Record, run: Run) -> Ranges:
    """Minimum and maximum of each column; empty while the poses make no table."""
    ranges: dict[str, tuple[float, float]] = {}
    for sensor in run.batch or (None,):
        try:
            table = MeasuredRun(record, run, sensor).table()
        except (RecordError, CalibrationError):
            continue
        prefix = f"{sensor}." if sensor else ""
        ranges |= {prefix + name: (float(v.min()), float(v.max())) for name, v in table.columns.items()}
    return ranges


def _poses(record: Record, run: Run) -> list[dict[str, Any]]:
    """Every pose as JSON, or every row of an imported table, with the reason if it is excluded."""
    table = MeasuredRun(record, run).imported() if not run.bench and run.kind in MEANS else None
    if table is None:
        return list(_iterate_poses(record, run))
    reasons = record.excluded(run.run)
    cells = {**table.labels, **{name: values.tolist() for name, values in table.columns.items()}}
    return [
        {"pose": number, **{name: values[number] for name, values in cells.items()}, "excluded": reasons.get(number)}
        for number in range(table.n)
    ]


def _iterate_poses(record: Record, run: Run) -> Iterator[dict[str, Any]]:
    """Every measured pose as JSON."""
    units: Mapping[str, str] | None = None
    for recorded in record.kept(run.run):
        units = units_of(run, recorded.samples.channels) if units is None else units
        yield _pose(recorded, units)


def _pose(recorded: KeptPose, units: Mapping[str, str]) -> dict[str, Any]:
    """One pose as JSON: means in V, and those of channels in other `units`."""
    names = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip", "up", "rate_deg_s")
    angles = {name: getattr(recorded.pose, name) for name in names}
    circumstances = {"t_s": recorded.t_s, "temperature_c": recorded.temperature_c, "excluded": recorded.excluded}
    means = recorded.dwell.means
    values: dict[str, Any] = {"means_v": {name: v for name, v in means.items() if name not in units}}
    if units:
        values |= {"means": {name: means[name] for name in units if name in means}, "units": dict(units)}
    return {
        "pose": recorded.number, "path": recorded.pose.path, **angles, **circumstances, **values,
        "sha256": digest_of(recorded.samples),
    }  # fmt: skip


def _head(run: Run) -> list[str]:
    state = f"{run.state} {run.ended[:19].replace('T', ' ')} UTC" if run.ended else run.state
    head = [f"{run.run}: {run.procedure}, {state}, {run.extent}, a table of {run.kind}", f"from {run.source}"]
    remarks = [run.message] if run.message else []
    remarks += [f"Remark: {run.constants[EXPIRED]}."] if EXPIRED in run.constants else []
    return [*head, *remarks, *_settings(run.settings)]


def _settings(settings: Mapping[str, Any]) -> Iterator[str]:
    """A line for each setting; for a mapping, such as the columns of an imported file, a line for each entry."""
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from (f"  {name}: {key} = {entry}" for key, entry in value.items())
        elif isinstance(value, list) and len(value) > 1 and isinstance(value[0], str):  # those of a file
            yield f"  {name} = {len(value)} lines: {value[0]} ..."
        elif isinstance(value, list):
            yield f"  {name} = {', '.join(f'{entry:g}' if isinstance(entry, float) else str(entry) for entry in value)}"
        else:
            yield f"  {name} = {value}"


def _columns(ranges: Ranges) -> list[str]:
    return [f"  {name:16}{low:12.6g} .. {high:.6g}" for name, (low, high) in ranges.items()]


def _event(event: Event, message: str | None) -> str:
    """Time, kind and text of an event; without the text that is already shown as the message of the run."""
    text = f": {event.text}" if event.text and not (message or "").endswith(event.text) else ""
    return f"  {event.at[:19].replace('T', ' ')}  {event.what}{text}"


def _iterate_log(lines: Sequence[LogLine]) -> Iterator[str]:
    """Each line with its time of day (UTC) and the clock of the rig."""
    for line in lines:
        yield f"  {line.at[11:23]}  {line.clock_s:10.3f} s  {line.who}  {line.what}: {line.text}"


def _tabulate_poses(poses: Sequence[Mapping[str, Any]]) -> list[str]:
    """The poses as a table."""
    if not poses:
        return []
    if "means_v" not in poses[0]:
        return _rows(poses)
    units, means = poses[0].get("units", {}), [pose["means_v"] | pose.get("means", {}) for pose in poses]
    channels = list(means[0])
    rows = [
        (
            pose["pose"],
            f"{pose['alpha_deg']:g}",
            f"{pose['beta_deg']:g}",
            pose["path"],
            duration(pose["t_s"]),
            *(f"{mean[name]:.5f}" if name in mean else "" for name in channels),
            "" if pose["temperature_c"] is None else f"{pose['temperature_c']:.1f}",
            pose["excluded"] or "",
        )
        for pose, mean in zip(poses, means, strict=True)
    ]
    channel_heads = [f"{name} {units.get(name, 'V')}" for name in channels]
    head = ("pose", "alpha", "beta", "path", "t", *channel_heads, "C", "excluded because")
    return columns(head, rows).splitlines()


def _rows(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The rows of an imported table."""
    head = [name for name in rows[0] if name != "excluded"]
    cells = [[*(_cell(row[name]) for name in head), row["excluded"] or ""] for row in rows]
    return columns([*head, "excluded because"], cells).splitlines()


def _cell(value: object) -> str:
    return f"{value:.7g}" if isinstance(value, float) else str(value)


def _run_document(run: Run, events: list[Event], ranges: Ranges) -> dict[str, object]:
    return {
        "schema": "rig.show/1",
        "run": run.run,
        "procedure": run.procedure,
        "state": run.state,
        "message": run.message,
        "kind": run.kind,
        "poses": run.rows,
        "settings": run.settings,
        "bench": run.bench,
        "identities": run.identities,
        "constants": run.constants,
        "created": run.created,
        "ended": run.ended,
        "columns": {name: {"min": low, "max": high} for name, (low, high) in ranges.items()},
        "events": [{"at": event.at, "what": event.what, "text": event.text} for event in events],
        "results": run.results,
        EXPIRED: run.constants.get(EXPIRED),
    }


@click.command("exclude")
@click.argument("run", shell_complete=complete_run)
@click.argument("pose", type=click.IntRange(min=0))
@click.option("--reason", metavar="TEXT", help="The reason; the record stores it.")
@click.option("--include", is_flag=True, help="Include the pose again.")
@json_option
def exclude_command(run: str, pose: int, reason: str | None, include: bool, as_json: bool) -> None:
    """Exclude pose number POSE of RUN, or that row of an imported table, from every analysis.

    The pose stays in the record, with the reason and the date. The results of a complete run are computed again; an
    incomplete run measures the pose again on `rig resume`. `rig show RUN --poses` lists the numbers.
    """
    if include == bool(reason and reason.strip()):
        raise click.UsageError("give a reason (--reason TEXT), or include the pose again (--include)")
    from rig.services.exclusion import RESULTS, exclude

    with Record.to_find(run) as record:
        exclusion = exclude(record, run, [pose], None if include else reason)
        run = exclusion.run
        remarks = [event.text for event in record.events(run) if event.what == RESULTS]
    if as_json:
        excluded = None if include else reason
        emit({"schema": "rig.exclude/1", "run": run, "pose": pose, "excluded": excluded, "results": exclusion.results})
        return
    state = "included again" if include else f"excluded: {reason}"
    next_lines = (
        [f"results: {remarks[-1]}", *results_table(exclusion.results)]
        if exclusion.state == "complete" and remarks
        else []
    )
    if exclusion.state != "complete" and not include:
        next_lines = [f"Next: rig resume {run} measures it again"]
    click.echo("\n".join([f"{run}: pose {pose} {state}", *next_lines]))


@click.command("export")
@click.argument("data", shell_complete=complete_data)
@click.option(
    "--format", "kind", type=click.Choice(["csv", "parquet", "hdf5", "event-model"]), default="csv", show_default=True
)
@out_option("The file to write.", required=True)
@json_option
def export_command(data: str, kind: str, out: Path, as_json: bool) -> None:
    """Write DATA, a run or a file, to --out."""
    from rig.services.export import export

    with working(f"writing {out}"):
        rows = export(data, kind, out)
    if as_json:
        emit({"schema": "rig.export/1", "data": data, "format": kind, "rows": rows, "path": str(out)})
    else:
        note(f"{rows} rows to {out}")
