"""The verdict on a model: one enum, one function that decides it, one function that writes it in words.

A verdict is always that of the model that is judged. A diagnosis judges the given model, a discovery the final model,
with the effects that the search added.

    adequate        no effect is missing, and the residual is noise or an error within the limit that the user gave
    effect-missing  effects of the catalogue are missing, and they explain the residual (given model only)
    ambiguous       the data cannot decide: another effect explains them as well, a small part of the residual may be
                    the form of a named cause, or the data do not determine the model
    unexplained     the residual is more than noise, and no effect of the catalogue explains it
    incomplete      the residual is more than noise, and no search for effects was made yet (given model only)
    no-response     an output does not follow the poses; no effect is searched for
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import Enum, StrEnum
from typing import Any

from calibrations.criteria import MATERIAL, MOST_BY_FORM, MOST_UNEXPLAINED, SIGNIFICANT
from calibrations.text import count_words, join_words

MOST_NAMED = 4  # missing effects in a short sentence


class Verdict(StrEnum):
    """The verdict on a model; the value is that of the JSON documents."""

    ADEQUATE = "adequate"
    EFFECT_MISSING = "effect-missing"
    AMBIGUOUS = "ambiguous"
    UNEXPLAINED = "unexplained"
    INCOMPLETE = "incomplete"
    NO_RESPONSE = "no-response"

    @property
    def label(self) -> str:
        """The verdict as a label."""
        return self.value.replace("-", " ")


@dataclass(frozen=True)
class Finding:
    """One reason not to believe the data as stated; without a verdict it is a warning."""

    verdict: Verdict | None
    text: str


@dataclass(frozen=True)
class Closest:
    """The best candidate that is not significant: chance alone seldom shows as much."""

    name: str
    p_value: float


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """The facts of a search that hold for every model that it judges.

    alternatives  by effect, those that the data cannot separate from it
    left          unexplained part of the residual, in words
    spoilt        whether that part makes every effect of the search doubtful
    unresponsive  whether that part is an output that does not follow the poses
    searched      whether further effects were searched for after the last one was added
    enough        whether the search stopped at an error within the limit that the user gave
    remarks       further sentences
    """

    alternatives: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    left: str | None = None
    spoilt: bool = False
    unresponsive: bool = False
    searched: bool = True
    enough: bool = False
    remarks: tuple[str, ...] = ()

    @property
    def shared(self) -> dict[str, Any]:
        """The facts by name."""
        return {fact.name: getattr(self, fact.name) for fact in fields(Evidence)}


@dataclass(frozen=True, kw_only=True)
class Judgement(Evidence):
    """The facts on a model that decide its verdict, with the names for its text.

    model         its name
    missing       effects that it lacks, in the order in which a search adds them
    added         effects that the search added to it, named as causes
    refinements   effects that the search added for the form of a cause, or that are missing for it
    unknown       places of the signal chain where something acts that no effect of the catalogue describes
    share_left    part of the excess variance at the start of the search that stays
    undetermined  why the data do not determine the model
    closest       the best candidate, where none is significant
    error         error of the model with all missing effects, as a multiple of `floor`
    provisional   whether the names may change when further effects are added
    """

    model: str
    missing: tuple[str, ...] = ()
    added: tuple[str, ...] = ()
    refinements: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    share_left: float = 0.0
    undetermined: str | None = None
    closest: Closest | None = None
    error: float = 1.0
    floor: str = "the noise floor"
    provisional: bool = False

    @property
    def verdict(self) -> Verdict:
        """The verdict, decided by these facts."""
        return decide(self)

    @property
    def text(self) -> str:
        """The verdict in words."""
        return sentences(self)

    @property
    def headline(self) -> str:
        """The first sentence of the text."""
        return headline(self)

    @property
    def summary(self) -> str:
        """The text, or a short sentence: that the added effects complete the model, or how many effects are missing.

        Of many effects, or beside many added ones, it gives the numbers.
        """
        if self._complete:
            return "No effect is missing."
        base, *terms = self.model.split("+")
        is_grown = len(terms) > MOST_NAMED
        model = f"{base} with {len(terms)} added effects" if is_grown else self.model
        if self.verdict is Verdict.INCOMPLETE:
            return headline(replace(self, model=model))
        if self.verdict not in (Verdict.EFFECT_MISSING, Verdict.AMBIGUOUS):
            return self.text
        if len(self.missing) > MOST_NAMED:
            of_form = sum(name in self.refinements for name in self.missing)
            return f'The model "{model}" misses {counted(len(self.missing) - of_form, of_form)}.'
        if self.missing and is_grown:
            return f'The model "{model}" misses {join_words(self.missing)}.'
        if len(self.added) > MOST_NAMED:
            effects = counted(len(self.added), len(self.refinements))
            return f"Added: {effects}. Remaining error: {self.error:.3g} times {self.floor}."
        return self.text

    @property
    def rest(self) -> str:
        """The part of the text that the summary leaves out."""
        if self._complete:
            return " ".join([*_details(self), *self.remarks])
        return "" if self.summary == self.text else self.text

    @property
    def _complete(self) -> bool:
        return bool(self.added) and self.verdict is Verdict.ADEQUATE


def counted(causes: int, refinements: int) -> str:
    """Numbers of effects, for page, report and terminal: `7 effects, and 6 for their exact form`."""
    if not causes:
        return f"{count_words(refinements, 'effect', 'effects')} for the exact form of the others"
    whose = "its" if causes == 1 else "their"
    form = f", and {refinements} for {whose} exact form" if refinements else ""
    return f"{count_words(causes, 'effect', 'effects')}{form}"


class Residual(Enum):
    """The class of a residual, by the share of the excess variance that no effect explains.

    The forms of effects are approximate, so that a small part may belong to a named cause. A larger one is a further
    cause. Where it is larger still, the named effects have not explained the data, and any of them may be wrong.
    """

    NOISE = "noise"
    FORM = "the form of a named cause, or a further cause"
    CAUSE = "a further cause"
    DOUBT = "a cause that makes the named effects doubtful"

    @classmethod
    def of(cls, j: Judgement) -> Residual:
        """By one scale for every model and every kind of data."""
        if j.left is None:
            return cls.NOISE
        if j.spoilt or j.share_left > MOST_UNEXPLAINED:
            return cls.DOUBT
        return cls.FORM if j.share_left <= MOST_BY_FORM else cls.CAUSE


def decide(j: Judgement) -> Verdict:
    """The verdict on a model. Every command, page and document asks this function.

    Named effects are missing from a given model unless the residual makes them doubtful. A final model is complete up
    to the form of its causes, or a further cause is unexplained.
    """
    residual = Residual.of(j)
    if j.unresponsive:
        return Verdict.NO_RESPONSE
    if _only_compared(j):
        return Verdict.INCOMPLETE
    if residual is Residual.DOUBT or (residual is Residual.CAUSE and not j.missing):
        return Verdict.UNEXPLAINED
    if j.unknown:
        return Verdict.UNEXPLAINED
    inseparable = any(j.alternatives.get(name) for name in (*j.missing, *j.added))
    if j.missing:
        return Verdict.AMBIGUOUS if inseparable else Verdict.EFFECT_MISSING
    if j.enough:
        return Verdict.AMBIGUOUS if inseparable else Verdict.ADEQUATE
    if residual is Residual.FORM or inseparable or j.undetermined is not None or _incomplete(j):
        return Verdict.AMBIGUOUS
    return Verdict.ADEQUATE


def sentences(j: Judgement) -> str:
    """The verdict in words, the same for terminal, page, report and JSON."""
    return " ".join([headline(j), *_details(j), *j.remarks])


def headline(j: Judgement) -> str:
    """The first sentence."""
    if j.verdict is Verdict.NO_RESPONSE:
        return f"No response: {j.left}."
    if j.verdict is Verdict.INCOMPLETE:
        return f'The model "{j.model}" is incomplete: its error is {j.error:.3g} times {j.floor}.'
    if j.verdict is Verdict.UNEXPLAINED and j.unknown and not j.spoilt:
        return f"An effect that is not in the catalogue acts at {join_words(j.unknown)}."
    if j.verdict is Verdict.UNEXPLAINED and not j.searched:
        return f"With {join_words(j.added)}, the residual is still more than noise: {j.left}."
    if j.verdict is Verdict.UNEXPLAINED:
        return f"No effect of the catalogue explains the residual: {j.left}."
    if j.missing:
        return f'The model "{j.model}" misses {join_words(j.missing)}.'
    if j.added:
        return f'The model "{j.model}" misses {join_words(j.added)}.'
    if j.enough:
        return f'The model "{j.model}" needs no further effect.'
    if j.undetermined is not None:
        return f"No effect is significant, but {j.undetermined}."
    if j.closest is not None:
        return (
            f"No effect is significant. Closest: {j.closest.name} (p = {100 * j.closest.p_value:.2g} %, threshold "
            f"{100 * SIGNIFICANT:.2g} %). Repeat the measurement to decide."
        )
    return "No effect is missing."


def _details(j: Judgement) -> Iterator[str]:
    """Further sentences."""
    if j.verdict is Verdict.NO_RESPONSE:
        return
    if j.verdict is Verdict.INCOMPLETE:
        yield f"It is largest here: {j.left}. Only a search can show which effects are missing."
        return
    if j.verdict is Verdict.UNEXPLAINED:
        if j.missing:
            yield f'The model "{j.model}" also misses {join_words(j.missing)}.'
        elif j.added and j.searched:
            yield f'The model "{j.model}" also misses {join_words(j.added)}.'
        if j.unknown and not j.spoilt:
            yield _remaining_error(j)
    elif not (j.missing or j.enough) and j.closest is None and j.undetermined is None:
        yield _remaining_error(j)
    elif j.left is not None and not j.spoilt:
        yield f"Remaining with them: {j.left}."
    if of_form := [name for name in j.refinements if name in j.missing]:
        others = [name for name in j.missing if name not in of_form]
        whose = others[0] if len(others) == 1 else "the others"
        yield f"Of these, {join_words(of_form)} only describe{'s' * (len(of_form) == 1)} the exact form of {whose}."
    elif j.refinements and (j.added or j.missing or j.unknown):
        yield refinement_text(len(j.added or j.missing), j.refinements)
    elif j.refinements:
        yield f"The model also has {join_words(j.refinements)}, which noise may explain as well."
    for name in (*j.missing, *j.added):
        if rivals := j.alternatives.get(name):
            yield f"This data cannot separate {name} from {join_words(rivals, 'or')}."
    if j.provisional and j.missing:
        yield "Provisional: the names may change when further effects are added."


def refinement_text(causes: int, refinements: Sequence[str]) -> str:
    """The effects that a model has only for the exact form of its causes; many of them with their numbers."""
    if causes <= MOST_NAMED:
        return f"To describe the exact form of these effects, the model also has {join_words(refinements)}."
    return f"The model has {counted(causes, len(refinements))}: {join_words(refinements)}."


def _only_compared(j: Judgement) -> bool:
    """Whether the residual is more than noise, and nothing is known of effects: no search was made, none was added."""
    return j.left is not None and not (j.searched or j.added or j.missing)


def _incomplete(j: Judgement) -> bool:
    """Whether the residual is more than noise, and no search for further effects was made."""
    return not j.searched and j.error > MATERIAL


def _remaining_error(j: Judgement) -> str:
    completeness = (
        f"With {join_words(j.added)}, no effect is missing. " if j.added and j.verdict is Verdict.ADEQUATE else ""
    )
    error = f"{completeness}Remaining error: {j.error:.3g} times {j.floor}"
    if j.left is None:
        noise = " The part above it is slow noise or scatter between rows: it has no pattern."
        noise_text = noise if j.error > MATERIAL else ""
        return f"{error}. No search for further effects was made." if _incomplete(j) else f"{error}.{noise_text}"
    causes = f" The cause may be the exact form of {join_words(j.added, 'or')}, or one more effect." if j.added else ""
    return f"{error}: {j.left}.{causes}"
