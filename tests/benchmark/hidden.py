"""The shipped discovery on hidden causes from a foreign simulation: `python -m tests.benchmark.hidden [KIND ...]`.

    --every K      every K-th set of a kind
    --offset O     the first set of a kind
    --folder DIR   sets/*.csv.gz and truth.json (default: tests/data/hidden)
    --limit S      seconds for one set; a longer search counts as an error
    --show         every set with a wrong answer, and the places that act, with their sizes in noise floors

A line a kind. `exact`: every cause is named and nothing else. A cause counts as named, too, if the answer lists it as
an alternative of the named cause and the pair is in ALIKE. Times are processor time of this process; run with
OMP_NUM_THREADS=1.
"""

from __future__ import annotations

import argparse
import json
import signal
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import calibrations as cal

FOLDER = Path(__file__).parents[1] / "data" / "hidden"
KINDS = ("single", "null", "unknown", "pair", "triple", "many5", "many8")
UNSEEN = (1.15, 1.5, 3.0)  # bounds of the held-out error, in noise floors
LIMIT_S = 120
ALIKE = {
    frozenset(pair)
    for pair in (
        ("axis-misalignment", "stage-zero-offset"),
        ("base-tilt", "stage-zero-offset"),
        ("axis-misalignment", "base-tilt"),
        ("axis-misalignment", "z-axis-bias"),
        ("axis-misalignment", "axis-nonorthogonality"),
        ("cross-axis-bias", "axis-nonorthogonality"),
        ("warm-up-bias", "temperature-bias"),
        ("bias-drift", "temperature-bias"),
        ("bias-drift", "warm-up-bias"),
        ("warm-up-scale", "temperature-scale"),
        ("hysteresis", "stage-backlash"),
        ("adc-nonlinearity", "quadratic-nonlinearity"),
    )
}  # pairs of which one may replace the other, if the answer itself lists them as inseparable


@dataclass(frozen=True)
class Answer:
    """The answer of a search on one set. `held_out` in noise floors, None after an error."""

    verdict: str
    causes: Sequence[str] = ()
    alternatives: Mapping[str, Sequence[str]] = field(default_factory=dict)
    held_out: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Score:
    """The answer on one set against its truth. `named` by true cause, `right` by named cause."""

    name: str
    truth: Sequence[str]
    answer: Answer
    named: Sequence[bool]
    right: Sequence[bool]
    processor_s: float

    @property
    def exact(self) -> bool:
        """Whether the answer has all causes and no other."""
        return all(self.named) and all(self.right) and len(self.answer.causes) == len(self.truth)

    def is_good(self, kind: str) -> bool:
        """Whether this is the answer that the kind of set asks for."""
        if kind == "unknown":
            return self.answer.verdict == "unexplained"
        return not self.answer.causes if kind == "null" else self.exact


def shipped(path: Path) -> Answer:
    """The answer of `rig discover`, in this process."""
    result = cal.discover(cal.read(path), "linear")
    held_out = result.findings.end.held_out_excess
    places = ", ".join(f"{place.name} {place.size:.1f}" for place in result.findings.places)
    return Answer(str(result.verdict), result.causes, result.alternatives, held_out, places)


def score(name: str, truth: Sequence[str], answer: Answer, processor_s: float) -> Score:
    """The answer against the hidden causes `truth`."""

    def same(cause: str, true: str) -> bool:
        listed = frozenset((cause, true)) in ALIKE and true in answer.alternatives.get(cause, ())
        return cause == true or listed

    named = [any(same(cause, true) for cause in answer.causes) for true in truth]
    right = [any(same(cause, true) for true in truth) for cause in answer.causes]
    return Score(name, truth, answer, named, right, processor_s)


def summary(kind: str, scores: Sequence[Score]) -> str:
    """The line of one kind."""
    words = [f"{kind:8} n={len(scores)}"]
    if kind == "null":
        words.append(f"something named: {sum(bool(s.answer.causes) for s in scores)}")
    elif kind == "unknown":
        words.append(f"unexplained: {_share(s.answer.verdict == 'unexplained' for s in scores)}")
        words.append(f"no name: {_share(not s.answer.causes for s in scores)}")
    else:
        recall, precision = _share(x for s in scores for x in s.named), _share(x for s in scores for x in s.right)
        words.append(f"exact {_share(s.exact for s in scores)}, recall {recall}, precision {precision}")
        errors = [s.answer.held_out if s.answer.held_out is not None else float("inf") for s in scores]
        words.append("held-out error <= " + ", ".join(f"{x:g}: {_share(e <= x for e in errors)}" for x in UNSEEN))
    if failures := sum(s.answer.verdict == "error" for s in scores):
        words.append(f"errors: {failures}")
    seconds = [s.processor_s for s in scores]
    return ", ".join([*words, f"median {median(seconds):.1f} s, longest {max(seconds):.1f} s"])


def _share(values: Iterable[bool]) -> str:
    listed = list(values)
    return f"{sum(listed) / max(len(listed), 1):.0%}"


def timed(search: Callable[[Path], Answer], path: Path, limit_s: int) -> tuple[Answer, float]:
    """The answer and its processor time, s. An exception and a passed limit become the verdict "error"."""

    def stop(*_: Any) -> None:
        raise TimeoutError(f"no answer within {limit_s} s")

    before = signal.signal(signal.SIGALRM, stop)
    began = time.process_time()
    signal.alarm(limit_s)
    try:
        answer = search(path)
    except Exception as error:
        answer = Answer("error", note=repr(error)[:200])
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    return answer, time.process_time() - began


def main(search: Callable[[Path], Answer], description: str | None) -> None:
    """Score `search` on the sets that the command line selects."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join(KINDS)} (default: all)")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--offset", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--limit", type=int, default=LIMIT_S)
    parser.add_argument("--show", action="store_true")
    options = parser.parse_args()
    if unknown := set(options.kinds) - set(KINDS):
        parser.error(f"no kind {', '.join(sorted(unknown))}; the kinds are {', '.join(KINDS)}")
    truths = json.loads((options.folder / "truth.json").read_text())
    for kind in options.kinds or KINDS:
        names = [name for name, truth in truths.items() if truth["kind"] == kind]
        scores = []
        for name in names[options.offset :: options.every]:
            answer, seconds = timed(search, options.folder / "sets" / f"{name}.csv.gz", options.limit)
            scores.append(score(name, truths[name]["causes"], answer, seconds))
            if options.show and not scores[-1].is_good(kind):
                print(f"    {name}, truth: {', '.join(scores[-1].truth)}, answer: {answer}", flush=True)
        if scores:
            print(summary(kind, scores), flush=True)


if __name__ == "__main__":
    main(shipped, __doc__)
