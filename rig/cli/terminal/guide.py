"""The guided terminal: shows the plan, the progress and the values of a run, and asks a person questions."""

from __future__ import annotations

import select
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from types import TracebackType
from typing import Self, TextIO, cast

from rich.console import Console, RenderableType
from rich.live import Live
from rich.prompt import Prompt
from rich.text import Text, TextType

from procedures.catalogue import Procedure
from procedures.errors import BadAnswer, Declined, NoAnswer
from procedures.questions import Choice, Question
from procedures.session import Guidance, Reading
from rig.bench import Bench
from rig.cli.terminal.screen import screen, screen_before_run, sketch_with_legend
from rig.drawings import Attitude, drawing_of, page
from rig.files import free_bytes, home, write_whole
from rig.planning.plan import Plan
from rig.planning.preparation import mounting
from rig.record import KeptPose
from rig.runs.observer import NEXT_STEP, RunViewer
from rig.runs.runner import Decision, Outcome

BEGIN = Choice("begin", "Begin?", choices=("go", "cancel"))
FRAMES_HZ = 8
LINE_WAIT_S = 0.1


class LinePrompt(Prompt):
    """A question that reads the terminal when a line is there, so that a signal ends it at any moment.

    A signal just before a read that blocks would be noticed only after the next line.
    """

    @classmethod
    def get_input(cls, console: Console, prompt: TextType, password: bool, stream: TextIO | None = None) -> str:
        """The next line, after the prompt."""
        if not sys.stdin.isatty():  # a pipe's lines may be in a buffer of Python, which `select` does not see
            return super().get_input(console, prompt, password, stream)
        console.print(prompt, end="")
        while not select.select([sys.stdin], [], [], LINE_WAIT_S)[0]:
            pass
        return super().get_input(console, "", password, stream)


class Guide(RunViewer):
    """Shows a run on standard error while it runs."""

    place = "in a terminal"

    def __init__(
        self, procedure: Procedure, bench: Bench, answers: Mapping[str, str], console: Console | None = None
    ) -> None:
        super().__init__(procedure.name, bench)
        self._procedure, self._bench, self._answers = procedure, bench, answers
        self._console = console or Console(stderr=True)
        self._drawn: Attitude | None = None
        self._live = Live(
            get_renderable=self._render, console=self._console, refresh_per_second=FRAMES_HZ, transient=True
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def planned(self, plan: Plan) -> None:
        """Show the plan on one screen; raises Declined if the person cancels it."""
        super().planned(plan)
        self._console.print(
            screen_before_run(plan, self._procedure, self._bench, free_bytes(home()), datetime.now(UTC).date())
        )
        if plan.reach:  # without stages there is no mounting
            self._draw(mounting(plan), "mounting")
        if self.ask(BEGIN, "go") == "cancel":
            raise Declined("cancelled before the start; nothing moved and nothing was recorded")

    def begun(self, run: str) -> None:
        super().begun(run)
        self._live.start()

    def guide(self, guidance: Guidance) -> None:
        """Show the next orientation. A sound and a tick mark a position that was taken: the person looks elsewhere."""
        previous = self.view.guidance
        super().guide(guidance)
        if previous is not None and len(guidance.taken) > len(previous.taken):
            self._console.bell()
            self._console.print(f"✓ position {len(guidance.taken)} taken", style="green", highlight=False)
        self._console.print(guidance.text, style="bold", highlight=False)

    def read(self, reading: Reading) -> None:
        super().read(reading)
        self._console.print(f"{reading.name} = {reading.value:g} {reading.unit}", highlight=False)

    def ask(self, question: Question, instead: str | None) -> str:
        """Ask until the answer is valid; the answer of a simulated bench is the proposal."""
        if question.name in self._answers:
            return self._answers[question.name]
        with self._hide_screen():
            if (attitude := drawing_of(question)) is not None:
                self._draw(attitude, question.name)
            return self._prompt(question, instead)

    def interrupted(self, outcome: Outcome) -> Decision:
        """The menu of an interrupted run."""
        self._live.stop()
        for complaint in outcome.moving:
            self._console.print(complaint, style="bold red", highlight=False)
        self._console.print(str(outcome.error), style="yellow", highlight=False)
        self._console.print(_choices(self.view.kept, outcome))
        try:
            return cast(Decision, self._prompt(NEXT_STEP, "resume"))
        except NoAnswer:
            return "end"

    @contextmanager
    def _hide_screen(self) -> Iterator[None]:
        """Hide the live screen during a question."""
        was_live = self._live.is_started
        self._live.stop()
        yield
        if was_live:
            self._live.start()

    def _prompt(self, question: Question, instead: str | None) -> str:
        text = f"{question.text} ({question.accepts})"
        while True:
            try:
                typed = LinePrompt.ask(Text(text), console=self._console, default=instead or "")
            except EOFError:
                raise NoAnswer(f'the terminal was closed at the question "{question.text}"; resume the run') from None
            try:
                return question.checked(typed)
            except BadAnswer as error:
                self._console.print(str(error), style="yellow", highlight=False)

    def _draw(self, attitude: Attitude, name: str) -> None:
        """Show the mounting of the sensor if it has changed; write the complete drawing to a file."""
        if attitude == self._drawn:
            return
        folder = home() / "drawings"
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(file := folder / f"{name}.svg", page(attitude))
        self._console.print(sketch_with_legend(attitude, file))
        self._drawn = attitude

    def _render(self) -> RenderableType:
        return screen(self.view, time.monotonic())


def _choices(recorded: KeptPose | None, outcome: Outcome) -> Text:
    """The meaning of each answer."""
    last = "" if recorded is None else f" (alpha {recorded.pose.alpha_deg:g}, beta {recorded.pose.beta_deg:g} deg)"
    return Text(
        "  resume  continues with the interrupted pose\n"
        f"  repeat  also repeats the last recorded pose{last}; the record keeps the first one, excluded\n"
        f"  end     ends for now; later: rig resume {outcome.run.run}"
    )
