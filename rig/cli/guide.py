"""The guided terminal: what happens now, progress, time left, live readings, and questions to a person."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import TracebackType
from typing import Self

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from rich.prompt import Prompt
from rich.table import Table
from rich.text import Text

from procedures.errors import BadAnswer
from procedures.questions import Question
from procedures.session import Reading
from rig.cli.output import duration
from rig.plan import Plan
from rig.record import Kept
from rig.runner import Outcome, Wish


class Guide:
    """Shows a run on standard error while it goes on."""

    def __init__(self, procedure: str, answers: Mapping[str, str], console: Console | None = None) -> None:
        self._answers = answers
        self._console = console or Console(stderr=True)
        self._bar = Progress(
            TextColumn("[bold]{task.description}"), BarColumn(), MofNCompleteColumn(), console=self._console
        )
        self._task = self._bar.add_task(procedure, total=None)
        self._now, self._left, self._readings = Text("connecting"), Text(""), Table.grid(padding=(0, 2))
        self._first_done, self._began_s = 0, time.monotonic()
        self._live = Live(self._page(), console=self._console, refresh_per_second=8)

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def planned(self, plan: Plan) -> None:
        """Nothing yet."""

    def begun(self, run: str) -> None:
        self._console.print(f"run {run}; Ctrl-C stops the stages, `rig resume {run}` goes on", highlight=False)

    def doing(self, text: str) -> None:
        self._now = Text(text)
        self._live.update(self._page())

    def expect(self, total: int, done: int) -> None:
        self._first_done, self._began_s = done, time.monotonic()
        self._bar.update(self._task, total=total, completed=done)

    def kept(self, kept: Kept) -> None:
        self._bar.advance(self._task)
        self._left = Text(f"{duration(self._left_s())} left", style="dim")
        self._readings = _readings(kept)
        self._live.update(self._page())

    def read(self, reading: Reading) -> None:
        self._console.print(f"{reading.name} = {reading.value:g} {reading.unit}", highlight=False)

    def ask(self, question: Question, instead: str | None) -> str:
        """Asked until the answer makes sense; a simulated bench's answer is proposed."""
        if question.name in self._answers:
            return self._answers[question.name]
        self._live.stop()
        try:
            return self._asked(question, instead)
        finally:
            self._live.start()

    def interrupted(self, outcome: Outcome) -> Wish:  # noqa: ARG002
        return "end"

    def _asked(self, question: Question, instead: str | None) -> str:
        text = f"{question.text} ({question.accepts})"
        while True:
            given = Prompt.ask(Text(text), console=self._console, default=instead or "")
            try:
                return question.checked(given)
            except BadAnswer as refused:
                self._console.print(str(refused), style="yellow", highlight=False)

    def _left_s(self) -> float:
        task = self._bar.tasks[0]
        done = task.completed - self._first_done
        return (time.monotonic() - self._began_s) / done * ((task.total or 0) - task.completed)

    def _page(self) -> Group:
        return Group(self._now, self._bar, self._left, self._readings)


def _readings(kept: Kept) -> Table:
    """The last dwell: mean and scatter of every channel, and the temperature."""
    table = Table.grid(padding=(0, 2))
    volts = kept.samples.volts
    for name, mean, std in zip(kept.samples.channels, volts.mean(axis=0), volts.std(axis=0), strict=True):
        table.add_row(name, f"{mean:.5f} V", f"scatter {1e3 * std:.3f} mV")
    if kept.temperature_c is not None:
        table.add_row("sensor", f"{kept.temperature_c:.1f} C", f"t = {duration(kept.t_s)}")
    return table
