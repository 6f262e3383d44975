"""A model session: data, a model, and effects added one by one, which can be undone.

The search for missing effects runs once and is a plan. As long as a person adds what the plan proposes, the session
follows it, proposes what `discover` would add next, and ends where `discover` ends. After another effect it searches
again from there; shares of the error stay those of the model that the session began with.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import takewhile
from threading import Thread, current_thread
from typing import Any, Generic

from calibrations.discovery.dataset import Dataset
from calibrations.discovery.findings import F, Findings, Step
from calibrations.discovery.results import Comparison, Diagnosis
from calibrations.discovery.verdict import Judgement
from calibrations.effects import Effect
from calibrations.errors import CalibrationError, ModelError
from calibrations.free_forms.place_names import PREFIX
from calibrations.free_forms.requested import resolve_effect as free_form_at
from calibrations.model import Model
from calibrations.progress import report
from rig.errors import RecordError
from rig.services.content import Content, content_of
from rig.services.load import load_request
from rig.services.next_experiment import Answer, planned
from rig.services.provenance import with_provenance
from rig.services.request import Request

Names = tuple[str, ...]
WAIT_S = 0.5  # for another thread, between two checks whether this one shall end


@dataclass(frozen=True)
class ModelSession(Generic[F]):
    """`model` on `data`, and the `steps` taken from there.

    `kept` are the data without gross outliers, `start` the fit to them. `effects` are those that may be added, `notes`
    is the note on the data, `change` says what has changed since the page was last open. `plans` are the searches so
    far by the effects added before them, and `searching` the threads that make one. Pages on the same data and model
    share both.
    `content` is that of data and model when they were read.
    """

    request: Request
    model: Model
    data: Dataset[F]
    kept: Dataset[F]
    effects: Mapping[str, Effect]
    notes: tuple[str, ...]
    start: F
    steps: tuple[Step[F], ...] = ()
    plans: dict[Names, Findings[F]] = field(default_factory=dict, compare=False)
    searching: dict[Names, Thread] = field(default_factory=dict, compare=False, repr=False)
    content: Content = field(default_factory=lambda: Content(""))
    change: str = ""

    @property
    def end(self) -> F:
        """The fit of the present model."""
        return self.steps[-1].after if self.steps else self.start

    @property
    def unit(self) -> str:
        """Unit of the outputs."""
        return self.data.unit

    @property
    def names(self) -> Names:
        """The effects added."""
        return tuple(step.name for step in self.steps)

    def with_effects(self, effects: Mapping[str, Effect]) -> ModelSession[F]:
        """The session with other effects that may be added."""
        return replace(self, effects=effects)

    def with_own(self, effect: Effect) -> ModelSession[F]:
        """The session with an effect that a user wrote. It replaces an earlier one of its name.

        Searches that know the earlier one are forgotten.
        """
        earlier = self.effects.get(effect.name)
        forgotten = earlier is not None and earlier.expression != effect.expression
        plans = {
            names: found
            for names, found in self.plans.items()
            if not forgotten or effect.name not in (*names, *found.names)
        }
        return replace(self, effects={**self.effects, effect.name: effect}, plans=plans)

    def tried(self, effect: Effect) -> Step[F]:
        """The present model with one more effect, fitted. Raises ModelError if it cannot be added."""
        if self.end.model.holds(effect.name):
            raise ModelError(f"{effect.name} is already in the model")
        plan = self._plan()
        if plan is not None and plan.names[:1] == (effect.name,):
            return plan.steps[0]
        self.data.require_allowed(effect)
        return self.data.step(effect, self.end)

    def written(self, name: str, text: str) -> Effect:
        """An effect that the user wrote: an expression, or a free form as `free:PLACE`.

        Raises ModelError, ExpressionError with the place in the text.
        """
        if text.startswith(PREFIX):
            return free_form_at(text, self.effects)
        known_effect = self.effects.get(name)
        if known_effect is not None and not known_effect.expression:
            raise ModelError(f"{name} is already in the catalogue; give yours another name")
        return self.data.expression(name, text)

    def with_step(self, step: Step[F]) -> ModelSession[F]:
        """The session with one more step."""
        return self._with_steps((*self.steps, step))

    def undone(self) -> ModelSession[F]:
        """The session without its last step; the first state has none."""
        return self._with_steps(self.steps[:-1])

    def removed(self, name: str) -> ModelSession[F]:
        """The session without the added effect `name`. The later ones are fitted again.

        An effect that the data cannot have without it is left out as well, with a note.
        """
        remaining = [text for text, added in zip(self.added, self.names, strict=True) if added != name]
        return self.with_added(remaining, f"Removing {name}, fitting {{}} again")

    @property
    def added(self) -> tuple[str, ...]:
        """The added effects as texts that `with_added` restores: a name, or NAME=EXPRESSION."""
        effects = (step.effect for step in self.steps)
        return tuple(f"{effect.name}={effect.expression}" if effect.expression else effect.name for effect in effects)

    def with_added(self, texts: Sequence[str], progress: str = "Adding {}") -> ModelSession[F]:
        """The session with exactly these added effects, in the form of `added`.

        The common beginning stays. An effect that the data cannot have is left out, with a note. `progress` is reported
        with the name of each effect that is fitted.
        """
        equal = takewhile(lambda pair: pair[0] == pair[1], zip(self.added, texts, strict=False))
        common = sum(1 for _ in equal)
        session = self if common == len(self.steps) else self._with_steps(self.steps[:common])
        for text in texts[common:]:
            name, equals, expression = text.partition("=")
            try:
                known_effect = session.effects.get(name)
                if known_effect is not None and known_effect.expression == expression:
                    effect = known_effect
                else:
                    effect = session.written(name, expression if equals else text)
                    session = session.with_own(effect)
                report(progress.format(name))
                session = session.with_step(session.tried(effect))
            except CalibrationError as error:
                note = f"{name} is not in the model any more: {error}"
                session = replace(session, notes=(*session.notes, note))
        return session

    def _with_steps(self, steps: tuple[Step[F], ...]) -> ModelSession[F]:
        start, steps = self.data.in_one_floor(self.start, steps)
        return replace(self, start=start, steps=steps)

    def complete_model(self) -> Model:
        """The present model as a file keeps it, with its provenance."""
        return with_provenance(self.data, self.end, self.model)

    def compared(self) -> Comparison[F]:
        """Compare the present model with the data. A given model with values keeps them."""
        report(f"Testing the model on {self.data.unseen}")
        given = None if self.steps else self.kept.evaluate(self.model)
        return self.kept.compare_fit(given or self.end)

    def judged(self) -> Judgement | None:
        """The verdict on the present model before its search; None if only a search can decide, or has decided."""
        return None if self._followed() is not None else self.kept.judge(self.end)

    def diagnosed(self) -> Diagnosis[F]:
        """The effects that the present model misses. Of two threads that ask, the second waits for the first."""
        self._wait_for_same_search()
        try:
            findings = self._plan() or self._search()
            self.plans[self.names] = findings
        finally:
            self.searching.pop(self.names, None)
        return Diagnosis.of(findings)

    def _wait_for_same_search(self) -> None:
        """Wait until no other thread makes this search: it has made it then, or was ended."""
        present = current_thread()
        while (other := self.searching.setdefault(self.names, present)) is not present:
            report("Waiting for the same search on another page")
            other.join(WAIT_S)
            if not other.is_alive() and self.searching.get(self.names) is other:
                self.searching.pop(self.names)

    def _plan(self) -> Findings[F] | None:
        """The rest of the longest earlier search that the steps have followed; None where they left all of them."""
        if (followed := self._followed()) is None:
            return None
        plan, count = followed
        return self.data.follow_plan(plan, count, self.effects) if count else plan

    def _followed(self) -> tuple[Findings[F], int] | None:
        """The longest earlier search that the steps have followed, and the number of its steps that they took."""
        for k in range(len(self.names), -1, -1):
            plan = self.plans.get(self.names[:k])
            remaining = self.names[k:]
            if plan is not None and plan.names[: len(remaining)] == remaining:
                return plan, len(remaining)
        return None

    @property
    def search_made(self) -> Findings[F] | None:
        """The search from the first model, if it was made among the present effects."""
        own = any(step.effect.expression for step in self.steps)
        return None if own else self.plans.get(())

    def first_search(self, watched: Callable[[Mapping[str, Effect]], Mapping[str, Effect]]) -> Findings[F] | None:
        """`search_made`, made now where it was not made yet; None with an effect that a user wrote.

        `watched` makes the effects of the search, which report its progress and may end it.
        """
        if self.search_made is None and not any(effect.expression for effect in self.effects.values()):
            self._with_steps(()).with_effects(watched(self.effects)).diagnosed()
        return self.search_made

    def _search(self) -> Findings[F]:
        if not self.steps:
            return self.data.search(self.model, self.effects)
        return self.data.search_on(self.end, self.start, self.effects)

    def with_next(self, result: Answer, notify: Callable[[str], None]) -> Answer:
        """The result with its next experiment planned on the bench; `notify` is called if it is another bench."""
        return planned(result, self.request, self.effects, notify)


def model_session(request: Request) -> ModelSession[Any]:
    """A new session of data (a file or a run) and a model. Raises what `load_request` and `fit` raise."""
    notes: list[str] = []
    content = Content("")
    with suppress(RecordError, OSError):  # `load_request` gives the better message
        content = content_of(request.data, request.model)  # before the data: a later row makes the session old
    report(f"Reading {request.data}")
    question = load_request(request, notes.append)
    report(f"Fitting {question.model.name} to {question.data.description}")
    prepared, start = question.data.fit_without_outliers(question.model)
    return ModelSession(
        request, question.model, question.data, prepared, question.effects, tuple(notes), start, content=content
    )


def brought_up_to_date(old: ModelSession[Any], new: ModelSession[Any], is_shown: bool = False) -> ModelSession[Any]:
    """The added effects of an old session on `new`, the present data without effects.

    `change` names the change, unless its page has shown it already (`is_shown`). An effect that the present data cannot
    have is left out, with a note.
    """
    extent_before, extent_now = old.content.extent or "a file", new.content.extent or "new"
    new = new.with_effects({**old.effects, **new.effects}).with_added(old.added)
    if is_shown:
        return new
    change = f"The data or the model have changed since this page was last open: {extent_before}, now {extent_now}."
    return replace(new, change=change)
