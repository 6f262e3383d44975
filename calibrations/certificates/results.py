"""A fit's figures for a certificate: each parameter with its expanded uncertainty, what that is made of, and decisions.

As left is what this calibration finds. As found is what the model that was in use before says: its values, and the
error that one would have made with them on the data of this calibration.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from calibrations.budget import SLOW, Budget, Line, budget, gains
from calibrations.certificates.content import Error, Figures, Outcome, Simulated, Source
from calibrations.certificates.decision import Limit, decide
from calibrations.certificates.monte_carlo import CONSERVATIVE, TRIALS, WIDENED, interval, simulate, tolerance, verdict
from calibrations.certificates.terms import name, term
from calibrations.correlation import correlation
from calibrations.errors import ModelError
from calibrations.fit import Fit, cautiously, evaluate
from calibrations.inputs import contributions
from calibrations.model import Estimate, Model, Term
from calibrations.noise import rms
from calibrations.table import Array
from calibrations.units import mg, milli

KINDS = ("poses", "positions", "rates")
MISFIT = 1.05  # Birge ratio from which on it is told
CERTAIN_K = 2.0  # coverage factor, where the degrees of freedom ask for no more


def figures(found: Fit, before: Model | None, limits: Mapping[str, Limit], trials: int = TRIALS) -> Figures:
    """All figures of a fit to poses, positions or rates; `before` is the model in use until now, with values.

    Raises ModelError for another kind of table, and where nothing is determined.
    """
    require_reference(found.table.source, found.table.kind)
    inputs = contributions(found.table)
    drawn = budget(found, inputs)
    trial = simulate(found, inputs, trials)
    weights = _weights(found)
    earlier = _values(before) if before is not None else {}
    certified = [k for k, (_, e) in enumerate(_estimates(found.model)) if e.identified and e.std]
    outcomes = tuple(
        _outcome(k, each, e, drawn, trial[:, k], weights[k], found, earlier, limits)
        for k, (each, e) in enumerate(_estimates(found.model))
        if k in certified
    )
    if not outcomes:
        raise ModelError(
            f"{found.table.source}: the data determine no parameter of {found.model.name}: nothing to certify"
        )
    joint = correlation(found, drawn, inputs)[np.ix_(certified, certified)]
    return Figures(
        found.model.name,
        outcomes,
        tuple(_errors(found, before)),
        drawn.not_given,
        trials,
        tuple(_remarks(found)),
        tuple(map(tuple, joint.tolist())),
    )


def require_reference(source: str, kind: str) -> None:
    """Raises ModelError for a kind of data whose parameters could be traced to nothing: no reference is known."""
    if kind not in KINDS:
        raise ModelError(
            f"{source}: a certificate is drawn up of poses, positions or rates, whose reference is known, and not "
            f"of {kind}. Certify a sweep of the sensor (`rig run sweep`); `rig report` has what this one shows"
        )


def _estimates(model: Model) -> Iterator[tuple[Term, Estimate]]:
    for each in model.terms:
        for e in each.estimates:
            yield each, e


def _values(model: Model) -> dict[tuple[str, str, str], tuple[float, float | None]]:
    return {(each.name, e.name, e.axis): (e.value, e.std) for each, e in _estimates(model) if e.identified}


def _outcome(
    k: int,
    of: Term,
    e: Estimate,
    drawn: Budget,
    trial: Array,
    weights: Array,
    found: Fit,
    earlier: Mapping[tuple[str, str, str], tuple[float, float | None]],
    limits: Mapping[str, Limit],
) -> Outcome:
    std, coverage = float(drawn.combined[k]), max(CERTAIN_K, float(drawn.coverage[k]))
    low, high = (float(end) for end in interval(trial))
    said = verdict(e.value, coverage * std, std, low, high)
    why = _why_further(k, coverage, std, float(trial.std()), drawn) if said == CONSERVATIVE else ""
    if said == WIDENED:
        coverage = max(coverage, (e.value - low) / std, (high - e.value) / std)
    limit = limits.get(own := name(of.effect, e.name, e.axis))
    order = np.argsort(-weights)
    numbers = found.table.numbered(np.arange(found.table.n))
    return Outcome(
        name=own,
        term=term(of.effect, next(p for p in of.effect.parameters if p.name == e.name)),
        effect=of.name,
        parameter=e.name,
        axis=e.axis,
        unit=e.unit,
        value=e.value,
        std=std,
        coverage=coverage,
        freedom=float(drawn.freedom[k]),
        sources=tuple(_source(line, k) for line in drawn.given),
        simulated=Simulated(float(trial.std()), low, high, said, why),
        found=earlier.get((of.name, e.name, e.axis)),
        decision=None if limit is None else decide(e.value, std, coverage * std, limit),
        weights=tuple((int(numbers[i]), float(weights[i])) for i in order),
    )


def _why_further(k: int, coverage: float, std: float, simulated: float, drawn: Budget) -> str:
    """By what a budget reaches further than the simulation, as far as it is known."""
    slow = any(line.source == SLOW and line.std is not None and line.std[k] > 0 for line in drawn.given)
    reasons = [
        "slow noise is not well known" if slow and CERTAIN_K * (std - simulated) > tolerance(std) else "",
        "few degrees of freedom" if (coverage - CERTAIN_K) * std > tolerance(std) else "",
    ]
    return ", ".join(filter(None, reasons))


def _source(line: Line, k: int) -> Source:
    sensitivity = None if line.sensitivity is None else float(line.sensitivity[k])
    part = 0.0 if line.std is None or np.isnan(line.std[k]) else float(line.std[k])
    return Source(line.source, line.kind, line.unit, line.input_std, sensitivity, part, line.freedom)


def _weights(found: Fit) -> Array:
    """By what share each row makes up the square of each parameter's sensitivities to the means, shape (p, n)."""
    squares = np.sum(gains(cautiously(found)) ** 2, axis=1)
    whole = squares.sum(axis=1, keepdims=True)
    return np.asarray(squares / np.where(whole > 0, whole, 1.0))


def _errors(found: Fit, before: Model | None) -> Iterator[Error]:
    """In thousandths of what is sensed, by channel; as found where the earlier model has every value that is needed."""
    earlier = None if before is None else evaluate(before, found.table)
    for c, channel in enumerate(found.channels):
        as_found = None if earlier is None else _size(earlier, c, found)
        yield Error(channel, milli(found), as_found, _size(found, c, found))


def _size(of: Fit, c: int, unit_of: Fit) -> tuple[float, float]:
    each = np.zeros((len(of.channels), 2))
    each[c] = rms(of.residual[c]), np.abs(of.residual[c]).max()
    return float(mg(each[:, 0], unit_of)[c]), float(mg(each[:, 1], unit_of)[c])


def _remarks(found: Fit) -> Iterator[str]:
    if found.birge > MISFIT:
        yield (
            f"The model leaves more than noise in the data (Birge ratio {found.birge:.2f}); the uncertainties are "
            "widened by it, and the budget shows it as misfit."
        )
    for each, e in _estimates(found.model):
        if not e.identified:
            what = f"{each.name} {f'{e.name} {e.axis}'.strip()}"
            yield f"Not determined by these data, and not certified: {what} ({e.why})."
    if not found.noise.known:
        yield "The noise of single means is not known; what they scatter by stands for it."
