"""The guided terminal: shown what will happen, what happens and how it is, asked what only a person can know."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from types import TracebackType
from typing import Self, cast

from rich.console import Console, RenderableType
from rich.live import Live
from rich.prompt import Prompt
from rich.text import Text

from procedures.catalogue import Procedure
from procedures.errors import BadAnswer, Declined, NoAnswer
from procedures.questions import Choice, Question
from procedures.session import Reading
from rig.bench import Bench
from rig.cli.terminal.screen import before, drawn, mounting, screen
from rig.drawings import Attitude, drawing_of, page
from rig.files import free_bytes, home, write_whole
from rig.planning.plan import Plan
from rig.record import Kept
from rig.runs.observer import Sight
from rig.runs.runner import Outcome, Wish

BEGIN = Choice("begin", "Begin?", choices=("go", "cancel"))
GO_ON = Choice("interrupted", "What now?", choices=("resume", "repeat", "end"))
FRAMES_HZ = 8


class Guide:
    """Shows a run on standard error while it goes on."""

    def __init__(
        self, procedure: Procedure, bench: Bench, answers: Mapping[str, str], console: Console | None = None
    ) -> None:
        self._procedure, self._bench, self._answers = procedure, bench, answers
        self._console = console or Console(stderr=True)
        self._drawn: Attitude | None = None
        self._sight = Sight(procedure.name, bench)
        self._live = Live(
            get_renderable=self._screen, console=self._console, refresh_per_second=FRAMES_HZ, transient=True
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def planned(self, plan: Plan) -> None:
        """One screen of what will happen; raises Declined where the person cancels it."""
        self._sight.planned(plan)
        self._console.print(before(plan, self._procedure, self._bench, free_bytes(home()), datetime.now(UTC).date()))
        self._draw(mounting(plan), "mounting")
        if self.ask(BEGIN, "go") == "cancel":
            raise Declined("cancelled before it began; nothing was moved and nothing recorded")

    def begun(self, run: str) -> None:
        """The run begins, or goes on."""
        self._sight.begun(f"{self._procedure.name}  {run}", run)
        self._live.start()

    def doing(self, text: str) -> None:
        self._sight.doing(text)

    def expect(self, total: int, done: int) -> None:
        self._sight.expect(total, done)

    def kept(self, kept: Kept) -> None:
        """The last dwell's values, beside what was usual before it."""
        self._sight.kept(kept)

    def read(self, reading: Reading) -> None:
        self._sight.read(reading)
        self._console.print(f"{reading.name} = {reading.value:g} {reading.unit}", highlight=False)

    def ask(self, question: Question, instead: str | None) -> str:
        """Asked until the answer makes sense; a simulated bench's answer is proposed."""
        if question.name in self._answers:
            return self._answers[question.name]
        with self._aside():
            if (attitude := drawing_of(question)) is not None:
                self._draw(attitude, question.name)
            return self._asked(question, instead)

    def interrupted(self, outcome: Outcome) -> Wish:
        """The menu of a run that stands still."""
        self._live.stop()
        for complaint in outcome.moving:
            self._console.print(complaint, style="bold red", highlight=False)
        self._console.print(str(outcome.error), style="yellow", highlight=False)
        self._console.print(_choices(self._sight.seen.kept, outcome))
        try:
            return cast(Wish, self._asked(GO_ON, "resume"))
        except NoAnswer:
            return "end"

    @contextmanager
    def _aside(self) -> Iterator[None]:
        """The live screen gives way to a question."""
        shown = self._live.is_started
        self._live.stop()
        yield
        if shown:
            self._live.start()

    def _asked(self, question: Question, instead: str | None) -> str:
        text = f"{question.text} ({question.accepts})"
        while True:
            try:
                given = Prompt.ask(Text(text), console=self._console, default=instead or "")
            except EOFError:
                raise NoAnswer(f'the terminal was closed at "{question.text}"; resume the run') from None
            try:
                return question.checked(given)
            except BadAnswer as refused:
                self._console.print(str(refused), style="yellow", highlight=False)

    def _draw(self, attitude: Attitude, name: str) -> None:
        """How to mount the sensor, unless that is on the screen already; the whole drawing is a file in the home."""
        if attitude == self._drawn:
            return
        folder = home() / "drawings"
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(file := folder / f"{name}.svg", page(attitude))
        self._console.print(drawn(attitude, file))
        self._drawn = attitude

    def _screen(self) -> RenderableType:
        return screen(self._sight.seen, time.monotonic())


def _choices(kept: Kept | None, outcome: Outcome) -> Text:
    """What each answer means."""
    last = "" if kept is None else f" (alpha {kept.pose.alpha_deg:g}, beta {kept.pose.beta_deg:g} deg)"
    return Text(
        "  resume  goes on with the pose that was under way\n"
        f"  repeat  measures the last kept pose{last} once more too; the first stays in the record, excluded\n"
        f"  end     leaves it for now: rig resume {outcome.run.run}"
    )
