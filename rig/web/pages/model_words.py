"""What the page Model says: of a model beside rows, and of a noise model beside a still record."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Protocol

from calibrations import diagnose
from calibrations.compare import Comparison
from calibrations.numerals import chance, plain
from calibrations.reports.verdict import headline
from calibrations.search.candidates import SIGNIFICANT, Candidate
from calibrations.search.held_out import held_out_excess
from calibrations.search.patterns import Pattern
from calibrations.still import compare as still_compare
from calibrations.still import diagnose as still_diagnose
from calibrations.still.documents import mismatch
from calibrations.still.held_out import held_out_excess as still_held_out
from calibrations.still.words import headline as still_headline
from calibrations.still.words import of_record
from calibrations.units import milli, pooled_mg, rows_of
from rig.analysis.growing import Candidate as AnyCandidate
from rig.analysis.growing import Growing
from rig.analysis.trail import Trail
from rig.analysis.trail_still import StillTrail

MOST_PLACES = 3
FLOOR, CHANCE = "the noise floor", "chance"


class Words(Protocol):
    """What is said alike of both."""

    def numbers(self, compared: Any, trail: Any) -> Mapping[str, str]:
        """The three numbers beside the verdict, by what they are."""

    def detail(self, compared: Any) -> str:
        """What was compared, and where the model fails."""

    def verdict(self, result: Any) -> str:
        """The verdict in a sentence."""

    def caution(self, result: Any) -> str | None:
        """What is to be known before the verdict is believed."""

    def left(self, result: Any) -> Pattern | None:
        """What is left unexplained, where that can be proposed as an effect of one's own."""

    def missing(self, result: Any) -> bool:
        """Whether there is something to add."""

    def facts(self, c: Any, result: Any) -> Mapping[str, str]:
        """What a candidate does here, by what it is."""


class OfRows:
    """Of poses, positions, motion and rates."""

    def numbers(self, compared: Comparison, trail: Trail) -> Mapping[str, str]:
        fit = compared.fit
        (error, floor), unit = pooled_mg(fit), milli(fit)
        return {
            "error": f"{plain(fit.pooled_excess)} × ({plain(error, 2)} {unit})",
            f"on unseen {rows_of(fit.table)}": f"{plain(held_out_excess(trail.end))} ×",
            "noise floor": f"{plain(floor, 2)} {unit}",
        }

    def detail(self, compared: Comparison) -> str:
        fit = compared.fit
        return _failing(f"{fit.model.name} on {fit.table.n} {rows_of(fit.table)}", compared)

    def verdict(self, result: diagnose.Diagnosis) -> str:
        return headline(result)

    def caution(self, result: diagnose.Diagnosis) -> str | None:
        return result.caution

    def left(self, result: diagnose.Diagnosis) -> Pattern | None:
        return result.pattern

    def missing(self, result: diagnose.Diagnosis) -> bool:
        return result.verdict in ("effect-missing", "ambiguous") and bool(result.path.steps)

    def facts(self, c: Candidate, result: diagnose.Diagnosis) -> Mapping[str, str]:
        kind = rows_of(result.fit.table)
        seen = f"{plain(result.excess_before)} → {plain(c.excess_after)} × {FLOOR}"
        unseen = f"{plain(result.held_out_before)} → {plain(c.held_out_after)} × {FLOOR}"
        return {f"Error, {kind} of the fit": seen, f"Error, unseen {kind}": unseen}


class OfNoise:
    """Of a still record."""

    def numbers(self, compared: still_compare.Comparison, trail: StillTrail) -> Mapping[str, str]:
        fit = compared.fit
        off = ", ".join(f"{100 * value:.2g} %" for value in mismatch(fit).values())
        return {
            "mismatch / chance": f"{plain(fit.pooled_excess)} ×",
            "on the other half": f"{plain(still_held_out(trail.end.model, trail.still))} ×",
            "Allan deviation is off by": off,
        }

    def detail(self, compared: still_compare.Comparison) -> str:
        return _failing(f"{compared.fit.model.name} on {of_record(compared.fit.still)}", compared)

    def verdict(self, result: still_diagnose.Diagnosis) -> str:
        return still_headline(result)

    def caution(self, result: still_diagnose.Diagnosis) -> None:  # noqa: ARG002 as that of rows
        return None

    def left(self, result: still_diagnose.Diagnosis) -> None:  # noqa: ARG002 as that of rows
        return None

    def missing(self, result: still_diagnose.Diagnosis) -> bool:
        return result.verdict in ("effect-missing", "ambiguous") and bool(result.missing)

    def facts(self, c: still_diagnose.Candidate, result: still_diagnose.Diagnosis) -> Mapping[str, str]:
        before, after = result.fit.pooled_excess, c.after.pooled_excess
        return {
            "Mismatch of the spectrum": f"{plain(before)} → {plain(after)} × {CHANCE}",
            "On the other half": f"{plain(result.held_out_before)} → {plain(c.held_out_after)} × {CHANCE}",
            "Log-likelihood": f"+{plain(c.gain / 2)}",
        }


def words_of(trail: Growing) -> Words:
    """Those for what lies open."""
    return OfNoise() if isinstance(trail, StillTrail) else OfRows()


def chances(c: AnyCandidate) -> str:
    """How probable it is that this is it, and that it is nothing."""
    beyond = "" if c.p_value < SIGNIFICANT else ", which is not significant"
    return f"{share(c.probability)}; by chance {chance(c.p_value)}{beyond}"


def share(probability: float) -> str:
    """Only approximate: neither certain nor impossible."""
    for limit, told in ((0.999, "above 99.9 %"), (0.99, "above 99 %")):
        if probability > limit:
            return told
    return "below 0.1 %" if probability < 1e-3 else f"{100 * probability:.2g} %"


def formula(text: str, unit: str) -> str:
    """A formula with the data's unit; what stands beside it comes in a line of its own, as a card is narrow."""
    return re.sub(r" {3,}", "\n", text.replace("{out}", unit)).replace("\n\n", "\n")


def _failing(what: str, compared: Comparison | still_compare.Comparison) -> str:
    places = "; ".join(place.text for place in compared.fails[:MOST_PLACES])
    return f"{what}. Fails: {places}." if places else f"{what}. No place stands out."
