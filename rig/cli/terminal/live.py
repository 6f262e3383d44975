"""`rig discover --live`: measure and diagnose in turns, with messages after each step and at the end."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import click

from calibrations.design.experiment import Experiment
from calibrations.documents import discovery_document
from calibrations.model.file import read_model
from calibrations.table import Table
from calibrations.text import duration, join_words
from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import Bench, read_bench
from rig.cli.terminal.output import emit, note, notes, verdict_status
from rig.cli.terminal.watch import watching
from rig.cli.terminal.words import discovery, parameters, warning
from rig.record import Record
from rig.record.measured import MeasuredRun
from rig.runs.live import FIRST, STANDARD, Live, Measurement, is_confirmed
from rig.runs.runner import start
from rig.services.provenance import write_model
from rig.services.request import Request, effects_of
from rig.services.tables import begin_time, join_runs


@dataclass
class Experiments:
    """Runs experiments on the bench like `rig run`, and keeps the names of the runs."""

    record: Record
    bench: Bench
    unattended: bool
    answers: Path | None
    runs: list[str] = field(default_factory=list)

    def measure(self, experiment: Experiment) -> tuple[str, Table]:
        """Run an experiment. Returns the run and the table of all runs so far. Raises the error that ended the run."""
        procedure = find(experiment.procedure, self.bench.folders.procedures)
        settings = parse(procedure, experiment.settings)
        with watching(procedure, self.bench, self.unattended, self.answers) as observer:
            outcome = start(
                self.record, self.bench, procedure, settings, observer, self.runs[-1] if self.runs else None
            )
        if outcome.error is not None:
            notes(outcome.moving)
            self._advise(outcome.run.run)
            raise outcome.error
        self.runs.append(outcome.run.run)
        return outcome.run.run, self._joined_table()

    def stopped(self) -> None:
        """Print the runs so far, after a stop between two runs."""
        if self.runs:
            note(f"The record has the measurements. Next: rig discover {' '.join(self.runs)}")

    def _joined_table(self) -> Table:
        measured = [MeasuredRun(self.record, self.record.run(run), self.bench.first_sensor) for run in self.runs]
        return join_runs([m.part("poses") for m in measured], [begin_time(self.record, run) for run in self.runs])

    def _advise(self, interrupted: str) -> None:
        note(f"The record has the measurements: {join_words([*self.runs, interrupted])}.")
        note(f"To continue: rig resume {interrupted}, then rig discover {' '.join([*self.runs, interrupted])}")


def discover_live(
    request: Request,
    out: Path | None,
    minutes: float | None,
    unattended: bool,
    answers: Path | None,
    check: bool,
    as_json: bool,
) -> int:
    """The command. Returns its exit status."""
    bench_file = request.bench_file
    bench, effects = read_bench(bench_file), effects_of(bench_file)
    start_model = read_model(request.model or "linear", effects)
    with Record() as record:
        experiments = Experiments(record, bench, unattended, answers)
        live = Live(bench, bench_file, start_model, effects, 60 * (minutes or 0.0), experiments.measure)
        standard_s = live.planned(STANDARD).duration_s or 0.0
        live = live if minutes else replace(live, time_s=standard_s)
        if (first_s := live.planned(FIRST).duration_s or 0.0) > live.time_s:
            raise click.UsageError(
                f"--time {minutes:g}: the first measurement takes {first_s / 60:.1f} minutes; give more time"
            )
        measurements: list[Measurement] = []
        try:
            for measurement in live.measurements():
                measurements.append(measurement)
                note(progress(measurements, live.time_s))
        except KeyboardInterrupt:
            experiments.stopped()
            raise
    discovered = measurements[-1].discovery
    path = write_model(discovered.findings.data, discovered.end, start_model, out, note)
    if as_json:
        emit(document(measurements, standard_s, path))
        notes(warning([discovered.caution]))
    else:
        click.echo(_end(measurements, live, standard_s, path))
    return verdict_status(discovered.verdict, check)


def progress(measurements: list[Measurement], time_s: float) -> str:
    """After a measurement: the verdict, the next experiment with its reason, the remaining time."""
    last, judgement = measurements[-1], measurements[-1].discovery.judgement
    poses = last.discovery.end.table.n
    lines = [f"{last.run}: {poses} poses in {duration(last.used_s)} so far. {judgement.text}"]
    if last.following is not None:
        e, remaining = last.following, duration(time_s - last.used_s)
        lines.append(f"Next, {duration(e.duration_s or 0.0)} of the remaining {remaining}: {e.command}\n    {e.why}")
    return "\n".join(lines)


def ending(measurements: list[Measurement], time_s: float) -> str:
    """The reason for the end."""
    if is_confirmed(measurements):
        return "The last measurement did not change the result."
    if measurements[-1].discovery.next_experiment is not None:
        return "The open question needs more time than remains, or another bench."
    return f"The time is over ({duration(time_s)}), or no experiment would help."


def document(measurements: list[Measurement], standard_s: float, out: Path | None) -> dict[str, Any]:
    """The document `rig.discovery/1`, with the experiments."""
    experiments = [
        {
            "procedure": m.experiment.procedure,
            "settings": dict(m.experiment.settings),
            "why": m.experiment.why,
            "run": m.run,
            "duration_s": m.experiment.duration_s,
            "verdict": m.discovery.verdict,
            "causes": list(m.discovery.causes),
        }
        for m in measurements
    ]
    times = {
        "rig_time_s": measurements[-1].used_s,
        "standard_rig_time_s": standard_s,
        "stands": is_confirmed(measurements),
    }
    runs = {"runs": [m.run for m in measurements], "experiments": experiments}
    return discovery_document(measurements[-1].discovery, str(out) if out else None) | runs | times


def _end(measurements: list[Measurement], live: Live, standard_s: float, out: Path | None) -> str:
    """Verdict, causes, model, and the rig time compared with that of the standard sweep."""
    discovered, used_s = measurements[-1].discovery, measurements[-1].used_s
    data = f"{discovered.end.table.n} poses of {join_words(m.run for m in measurements)}"
    time = f"Rig time {duration(used_s)}; the standard sweep takes {duration(standard_s)}."
    command_text = f"To repeat the analysis: rig discover {' '.join(m.run for m in measurements)}"
    parts = [
        data,
        discovery(discovered),
        parameters(discovered.end.model),
        f"{ending(measurements, live.time_s)} {time}\n{command_text}",
    ]
    return "\n\n".join([*parts, *([f"written: {out}"] if out else [])])
