"""Figures of a certificate: each parameter with its expanded uncertainty, its budget, and its decisions.

As left: the values of this calibration. As found: the values of the model in use before, and the error of that model on
the data of this calibration.

The propagation of distributions (GUM Supplement 1) checks the uncertainties of the budget. In each trial the means
get noise of the kind that the fit identified (white, scatter, slow, enlarged by the Birge ratio), and errors of the
inputs that are not fitted, normal with their standard uncertainties, each shared by its rows. The parameters are then
estimated anew, with the weights of the fit and the whole nonlinear model. First-order propagation neglects the
curvature of the model over its uncertainty and the shape of the result's distribution; the trials include both.
Inputs enter the residual by first order.

The simulation confirms the budget if both ends of the budget's interval are within half a unit of the first digit of
the standard uncertainty of the simulated ones. The budget is conservative if its interval is wider: it also counts
how uncertain the slow noise is. If the simulated interval is wider, the budget's is widened to it.

Source  JCGM 101:2008, 7 (trials), 7.7 (interval), 8.1 (comparison, one significant digit).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.discovery.fit_doubts import fit_doubts, misfit
from calibrations.discovery.plausibility import doubt, rejection
from calibrations.discovery.structure import find_unexplained_scatter
from calibrations.errors import ModelError, UnusableData
from calibrations.fitting.budget import SLOW_NOISE, Budget, make_budget, parameter_correlation, row_gains
from calibrations.fitting.fit import Fit, evaluate, in_milli, milli_unit
from calibrations.fitting.inputs import Contribution, input_contributions
from calibrations.geometry.rate_table import EARTH_DEG_S
from calibrations.means.noise import Noise, rms
from calibrations.model import Model
from calibrations.presentation.budget import sources
from calibrations.presentation.certificate.content import Error, Figures, Limit, Outcome, SimulatedInterval, decide
from calibrations.presentation.certificate.terms import name, term
from calibrations.progress import report
from calibrations.table import Array
from calibrations.tables import MEANS
from calibrations.text import exponent

TRIALS = 2000
REPORTED = 20  # trials between two reports of the progress
SEED = 101
LEVEL = 0.95
CONFIRMED, CONSERVATIVE, WIDENED = "confirmed", "conservative", "widened"


def simulate(fit: Fit, inputs: Sequence[Contribution], trials: int = TRIALS) -> Array:
    """Parameters of each trial, shape (trials, p). The same fit gives the same trials."""
    rng = np.random.default_rng(SEED)
    cautious = fit.in_all_noise()
    G = row_gains(cautious)
    disturbed = cautious.birge * _noise(cautious.noise, trials, rng)
    for c in inputs:
        if c.std:
            number = c.shared(fit.table)
            errors = c.std * rng.standard_normal((trials, int(number.max()) + 1))
            disturbed += c.derivative(fit.problem, fit.theta) * errors[:, None, number]
    at_fit = fit.problem.residual(fit.theta) - fit.residual  # the same in the first step of every trial
    values = np.empty((trials, len(fit.theta)))
    for k, disturbance in enumerate(disturbed):
        if k % REPORTED == 0:
            report(f"Simulating the uncertainties: trial {k} of {trials}")
        values[k] = _estimate(fit, G, at_fit, disturbance)
    return values


def interval(values: Array) -> tuple[Array, Array]:
    """The probabilistically symmetric 95 % interval of each column."""
    low, high = np.quantile(values, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0)
    return low, high


def tolerance(std: float) -> float:
    """Half a unit of the first digit of a standard uncertainty."""
    return 0.5 * 10.0 ** exponent(std) if std > 0 else 0.0


def verdict(value: float, expanded: float, std: float, low: float, high: float) -> str:
    """The verdict of the simulated interval (low, high) on value +- expanded."""
    margins = expanded - (value - low), expanded - (high - value)
    if min(margins) < -tolerance(std):
        return WIDENED
    return CONSERVATIVE if max(margins) > tolerance(std) else CONFIRMED


def _estimate(fit: Fit, G: Array, at_fit: Array, disturbed: Array) -> Array:
    """The parameters that the disturbed residual leads to: Newton's way with the fit's own gain, in two steps.

    The model is nearly straight over its uncertainty. `at_fit`: the undisturbed residual where the first step begins.
    """
    theta = fit.theta - np.einsum("pcn,cn->p", G, at_fit + disturbed)
    return np.asarray(theta - np.einsum("pcn,cn->p", G, fit.problem.residual(theta) - fit.residual + disturbed))


def _noise(noise: Noise, trials: int, rng: np.random.Generator) -> Array:
    """Noise of the means, shape (trials, channels, n)."""
    channels, n = noise.white.shape
    samples = noise.fast * rng.standard_normal((trials, channels, n))
    for c, (taus_s, slow) in enumerate(zip(noise.taus_s, noise.slow, strict=True)):
        for tau_s in taus_s if slow > 0 else ():
            samples[:, c] += (
                slow / np.sqrt(len(taus_s)) * _simulate_gauss_markov(np.exp(-noise.gap_s / tau_s), trials, rng)
            )
    return samples


def _simulate_gauss_markov(phi: Array, trials: int, rng: np.random.Generator) -> Array:
    """Gauss-Markov processes of unit variance, shape (trials, n), `phi` from each row to the next."""
    x = np.empty((trials, len(phi)))
    x[:, 0] = rng.standard_normal(trials)
    for i in range(1, len(phi)):
        x[:, i] = phi[i] * x[:, i - 1] + np.sqrt(1 - phi[i] ** 2) * rng.standard_normal(trials)
    return x


MISFIT = 1.05  # Birge ratio from which on it is reported
CERTAIN_K = 2.0  # coverage factor, where the degrees of freedom ask for no more


def figures(fit: Fit, earlier_model: Model | None, limits: Mapping[str, Limit], trials: int = TRIALS) -> Figures:
    """All figures of a fit to poses, positions, rates or fields; `earlier_model`: in use until now, with values.

    Raises ModelError for another kind of table, and where nothing is determined; UnusableData.
    """
    require_reference(fit.table.source, fit.table.kind)
    if (reason := rejection(fit) or find_unexplained_scatter(fit) or misfit(fit)) is not None:
        raise UnusableData(f"{fit.table.source}: no certificate: {reason.verdict}: {reason.text}")
    inputs = input_contributions(fit.table)
    budget = make_budget(fit, inputs)
    trial = simulate(fit, inputs, trials)
    earlier = _values(earlier_model) if earlier_model is not None else {}
    certified = [k for k, (_, e) in enumerate(fit.model.all_estimates) if e.identified and e.std]
    calibration = _Calibration(fit, budget, trial, _weights(fit), earlier, limits)
    outcomes = tuple(map(calibration.outcome, certified))
    if not outcomes:
        raise ModelError(f"{fit.table.source}: the data determine no parameter of {fit.model.name}: nothing to certify")
    joint = parameter_correlation(fit, budget, inputs)[np.ix_(certified, certified)]
    return Figures(
        fit.model.name,
        outcomes,
        tuple(_errors(fit, earlier_model)),
        budget.not_given,
        trials,
        tuple(_remarks(fit)),
        tuple(map(tuple, joint.tolist())),
    )


def require_reference(source: str, kind: str) -> None:
    """Raises ModelError for a kind of data whose parameters could be traced to nothing: no reference is known."""
    if kind not in MEANS:
        raise ModelError(
            f"{source}: a certificate needs poses, positions, rates or fields, whose reference is known; this is "
            f"{kind}. {OTHER_DATA.get(kind, SWEEP)}; `rig report` shows the results of this data"
        )


SWEEP = "Certify a sweep of the sensor (`rig run sweep`)"
OTHER_DATA = {
    "turns": "The angles of these turns come from an accelerometer on the board, whose errors have no stated "
    "uncertainty. Certify known rates (`rig run rate-turn`), or whole turns (`rig import --kind rates --constant "
    "turn_deg=360`)"
}


def _values(model: Model) -> dict[tuple[str, str, str], tuple[float, float | None]]:
    return {(t.name, e.name, e.axis): (e.value, e.std) for t, e in model.all_estimates if e.identified}


@dataclass(frozen=True)
class _Calibration:
    """A fit with everything that the figures of one parameter need.

    trials   parameters of the simulated trials, shape (trials, p)
    weights  weight of each row in each parameter, shape (p, n)
    earlier  value and standard uncertainty in the model in use until now, by effect, parameter and axis
    """

    fit: Fit
    budget: Budget
    trials: Array
    weights: Array
    earlier: Mapping[tuple[str, str, str], tuple[float, float | None]]
    limits: Mapping[str, Limit]

    def outcome(self, k: int) -> Outcome:
        """The figures of the parameter with index k."""
        model_term, e = self.fit.model.all_estimates[k]
        std, simulated = float(self.budget.combined[k]), self._simulated_interval(k)
        coverage = self._coverage(k)
        if simulated.verdict == WIDENED:
            coverage = max(coverage, (e.value - simulated.low) / std, (simulated.high - e.value) / std)
        limit = self.limits.get(parameter_name := name(model_term.effect, e.name, e.axis))
        numbers, weights = self.fit.table.numbered(np.arange(self.fit.table.n)), self.weights[k]
        return Outcome(
            name=parameter_name,
            term=term(model_term.effect, next(p for p in model_term.effect.parameters if p.name == e.name)),
            effect=model_term.name,
            parameter=e.name,
            axis=e.axis,
            unit=e.unit,
            value=e.value,
            std=std,
            coverage=coverage,
            freedom=float(self.budget.freedom[k]),
            sources=sources(self.budget, k),
            simulated=simulated,
            found=self.earlier.get((model_term.name, e.name, e.axis)),
            decision=None if limit is None else decide(e.value, std, coverage * std, limit),
            weights=tuple((int(numbers[i]), float(weights[i])) for i in np.argsort(-weights)),
        )

    def _coverage(self, k: int) -> float:
        """The coverage factor of the budget."""
        return max(CERTAIN_K, float(self.budget.coverage[k]))

    def _simulated_interval(self, k: int) -> SimulatedInterval:
        """The interval of the trials, and its verdict on that of the budget."""
        value, trial = self.fit.model.all_estimates[k][1].value, self.trials[:, k]
        std, coverage = float(self.budget.combined[k]), self._coverage(k)
        low, high = (float(end) for end in interval(trial))
        judgement = verdict(value, coverage * std, std, low, high)
        spread = float(trial.std())
        reason = _explain_wider_interval(k, coverage, std, spread, self.budget) if judgement == CONSERVATIVE else ""
        return SimulatedInterval(spread, low, high, judgement, reason)


def _explain_wider_interval(k: int, coverage: float, std: float, simulated: float, budget: Budget) -> str:
    """Why the interval of the budget is wider than that of the simulation, if a reason is known."""
    slow = any(line.source == SLOW_NOISE and line.std is not None and line.std[k] > 0 for line in budget.given)
    reasons = [
        "slow noise is not well known" if slow and CERTAIN_K * (std - simulated) > tolerance(std) else "",
        "few degrees of freedom" if (coverage - CERTAIN_K) * std > tolerance(std) else "",
    ]
    return ", ".join(filter(None, reasons))


def _weights(fit: Fit) -> Array:
    """Share of each row in the square of each parameter's sensitivities to the means, shape (p, n)."""
    squares = np.sum(row_gains(fit.in_all_noise()) ** 2, axis=1)
    total = squares.sum(axis=1, keepdims=True)
    return np.asarray(squares / np.where(total > 0, total, 1.0))


def _errors(fit: Fit, earlier_model: Model | None) -> Iterator[Error]:
    """Errors by channel, in thousandths of the sensed quantity; as found, if the earlier model has all values."""
    earlier = None if earlier_model is None else evaluate(earlier_model, fit.table)
    for c, channel in enumerate(fit.channels):
        as_found = None if earlier is None else _size(earlier, c, fit)
        yield Error(channel, milli_unit(fit), as_found, _size(fit, c, fit))


def _size(errors_of: Fit, c: int, unit_of: Fit) -> tuple[float, float]:
    sizes = np.zeros((len(errors_of.channels), 2))
    sizes[c] = rms(errors_of.residual[c]), np.abs(errors_of.residual[c]).max()
    return float(in_milli(sizes[:, 0], unit_of)[c]), float(in_milli(sizes[:, 1], unit_of)[c])


def _remarks(fit: Fit) -> Iterator[str]:
    for reason in (doubt(fit.table), *fit_doubts(fit)):
        if reason is not None:
            yield f"Check: {reason}."
    if fit.birge > MISFIT:
        yield (
            f"The residual is larger than the noise (Birge ratio {fit.birge:.2f}). The uncertainties are multiplied "
            "by this ratio, and the budget lists it as misfit."
        )
    for t, e in fit.model.all_estimates:
        if not e.identified:
            quantity = f"{t.name} {f'{e.name} {e.axis}'.strip()}"
            yield f"Not determined by these data and not certified: {quantity} ({e.why})."
    if fit.table.type.field:
        yield (
            "No reference for the strength of the field: the offset and the strength are in the sensor's own unit, and "
            "no scale factor is certified. The relative results need no reference: the field was the same in all rows."
        )
    if fit.table.type.turning and "latitude_deg" not in fit.table.constants:
        yield (
            f"The latitude is not stated: up to {EARTH_DEG_S:.4f} deg/s of the earth's rotation is in the bias and not "
            "in its uncertainty. Give latitude_deg."
        )
    if not fit.noise.known:
        yield "The noise of single means is not known; their scatter is used instead."
