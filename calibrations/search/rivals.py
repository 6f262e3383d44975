"""What the data cannot tell from an effect, each rival fitted in full and in its best shape.

A rival is as likely; or what it leaves is as good as noise: the form in which an effect acts is known only
approximately, and so is the column that it goes by. A fit that is better by some decimals is then no proof. In a
motion, whose rows repeat each other, it is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from calibrations.fit import Fit
from calibrations.noise_estimation.likelihood import twice_log_likelihood
from calibrations.search.candidates import NOT_TOLD_APART, SIGNIFICANT, Candidate, added
from calibrations.search.share import MATERIAL, OF_FORM, share_left

HALF = 0.5  # of the best one's gain: rivals with less of it have another shape altogether


def with_rivals(best: Candidate, found: Sequence[Candidate], before: Fit) -> Candidate:
    """`best`, one of the candidates `found` on top of `before`, with all that may stand in its place."""
    if best.p_value >= SIGNIFICANT:
        return best
    by_name = {c.name: c for c in found}
    like = [name for name in best.indistinguishable_from if name not in by_name or _open(by_name[name], best, before)]
    near = [c for c in found if c.name not in (best.name, *best.indistinguishable_from) and _near(c, best)]
    own = twice_log_likelihood(added(before, best)) if near else 0.0
    further = [c.name for c in near if _may_be(added(before, c), before, own)]
    return replace(best, indistinguishable_from=(*like, *further))


def _open(c: Candidate, best: Candidate, before: Fit) -> bool:
    """Whether a rival that has `best` within it may still be more: the data then leave a part of it undetermined.

    A play whose width is known to be none is no rival; one that no reversal has shown may have any width.
    """
    if best.name not in c.effect.contains:
        return True
    term = next(term for term in added(before, c).model.terms if term.name == c.name)
    return not all(e.identified for e in term.estimates)


def _near(c: Candidate, best: Candidate) -> bool:
    """Whether it explains much of the same with hardly more parameters. Neither is within the other: that is tested."""
    within = best.name in c.effect.contains or c.name in best.effect.contains
    return not within and c.rank <= best.rank + 1 and c.gain > HALF * best.gain


def _may_be(after: Fit, before: Fit, likeliest: float) -> bool:
    """`likeliest`: twice the log-likelihood with the effect whose rival this is."""
    if likeliest - twice_log_likelihood(after) < NOT_TOLD_APART:
        return True
    as_good = after.pooled_excess <= MATERIAL and share_left(before, after) <= OF_FORM
    return as_good and after.table.kind != "motion"
