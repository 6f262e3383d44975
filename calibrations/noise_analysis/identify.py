"""Which processes a spectrum shows, how strong they are, and how strong the others could be without being seen.

All are fitted; the one whose absence lowers the likelihood least is left out, as long as it is not missed. A process
that is not there is then named in one record of four hundred: under the null hypothesis twice the gain in
log-likelihood is zero or, half of the time, chi-square, since no power is negative. A Gauss-Markov process has a time
constant too, found among many, and has to gain more.

Source  Self and Liang, J. Am. Statist. Assoc. 82 (1987): likelihood ratios at a bound.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import chi2

from calibrations.noise_analysis.bands import Bands
from calibrations.noise_analysis.freedom import COVERAGE
from calibrations.noise_analysis.processes import GAUSS_MARKOV, LINEAR
from calibrations.noise_analysis.whittle import information, maximise
from calibrations.table import Array

COST = 7.88  # twice the log-likelihood that a process has to gain
DEARER = {
    "quantisation-noise": 12.0,  # one record in 4000: taken for white noise that is there, it would falsify that most
    GAUSS_MARKOV: 22.0,  # two parameters, of which one is searched for, and a shape that others together can take on
}
DOUBTED = ("flicker-noise", "rate-random-walk")  # they are alike where a record has few periods
DOUBT = 2.0  # twice the log-likelihood that one of them has to gain for even odds
LEAST = 1e-18  # of the greatest density: rounding
SURE = 4.0  # the same, for a slow process to be told from the other one
BOUND = 3.84  # twice the log-likelihood that is lost at the ends of an interval of 95 %
TIMES = 12  # time constants that are tried first
FASTEST, LONGEST = 3.0, 0.1  # of them, in sampling intervals and in lengths of the record


@dataclass(frozen=True)
class Spectrum:
    """Bands of one record that are fitted together."""

    parts: tuple[Bands, ...]

    @cached_property
    def frequency_hz(self) -> Array:
        return np.concatenate([part.frequency_hz for part in self.parts])

    @cached_property
    def density(self) -> Array:
        """Two-sided, unit^2/Hz; no band is quite without power."""
        density = np.concatenate([part.density for part in self.parts])
        return np.asarray(np.maximum(density, LEAST * density.max()))

    @cached_property
    def freedom(self) -> Array:
        return np.concatenate([part.freedom for part in self.parts])

    @property
    def interval(self) -> tuple[Array, Array]:
        """Bounds (b,) between which the true densities lie with a probability of COVERAGE each."""
        tail, nu = (1 - COVERAGE) / 2, self.freedom
        low, high = (self.density * nu / chi2.ppf(p, nu) for p in (1 - tail, tail))
        return low, high

    def column(self, process: str, time_constant_s: float = 0.0) -> Array:
        """What is expected of a process whose coefficient is 1."""
        if process in LINEAR:
            return self._linear[process]
        return np.concatenate([part.column(process, time_constant_s) for part in self.parts])

    @cached_property
    def _linear(self) -> dict[str, Array]:
        """Columns that are needed for every fit."""
        return {name: np.concatenate([part.column(name) for part in self.parts]) for name in LINEAR}


@dataclass(frozen=True)
class Mixture:
    """Processes and their powers: squares of coefficients. `time_constant_s` is that of a Gauss-Markov process."""

    power: Mapping[str, float]
    log_likelihood: float
    time_constant_s: float = 0.0

    @property
    def worth(self) -> float:
        """Twice the log-likelihood, less what each process costs."""
        return 2 * self.log_likelihood - sum(DEARER.get(name, COST) for name in self.power)

    def expected(self, of: Spectrum | Bands) -> Array:
        """Its spectrum."""
        parts = [v * of.column(name, self.time_constant_s) for name, v in self.power.items()]
        return np.asarray(np.sum(parts, axis=0))


def mixture(spectrum: Spectrum) -> Mixture:
    """The processes that the spectrum shows."""
    plain = _pruned(spectrum, _fitted(spectrum, tuple(LINEAR)))
    with_markov = _pruned(spectrum, most_likely_markov(spectrum, tuple(LINEAR)))
    return max(plain, with_markov, key=lambda each: each.worth)


def most_likely_markov(spectrum: Spectrum, beside: Sequence[str]) -> Mixture:
    """With a Gauss-Markov process of the most likely time constant among the others."""
    slow = spectrum.parts[0]
    shortest = FASTEST / spectrum.parts[-1].sampling.rate_hz
    longest = max(LONGEST / (2 * slow.frequency_hz[0]), 2 * shortest)
    names = (*beside, GAUSS_MARKOV)

    def loss(log_s: float) -> float:
        return -_fitted(spectrum, names, float(np.exp(log_s))).log_likelihood

    tried = np.linspace(np.log(shortest), np.log(longest), TIMES)
    best = int(np.argmin([loss(log_s) for log_s in tried]))
    ends = tried[max(0, best - 1)], tried[min(TIMES - 1, best + 1)]
    found = minimize_scalar(loss, bounds=ends, method="bounded", options={"xatol": 0.02})
    return _fitted(spectrum, names, float(np.exp(found.x)))


def _fitted(
    spectrum: Spectrum, names: Sequence[str], time_constant_s: float = 0.0, base: Array | None = None
) -> Mixture:
    G = np.column_stack([spectrum.column(name, time_constant_s) for name in names])
    base = np.zeros(len(G)) if base is None else base
    theta, value = maximise(G, spectrum.density, spectrum.freedom, base)
    return Mixture(dict(zip(names, theta.tolist(), strict=True)), float(value), time_constant_s)


def _pruned(spectrum: Spectrum, found: Mixture) -> Mixture:
    """Without the processes that are not missed; one stays."""
    while len(found.power) > 1:
        fewer = [
            _fitted(spectrum, [n for n in found.power if n != name], found.time_constant_s) for name in found.power
        ]
        best = max(fewer, key=lambda each: each.worth)
        if best.worth < found.worth:
            break
        found = best
    return found


def uncertainties(spectrum: Spectrum, found: Mixture) -> dict[str, float]:
    """Standard deviation of each coefficient, and of the time constant, under `time_constant_s`."""
    columns = [spectrum.column(name, found.time_constant_s) for name in found.power]
    roots = [2 * np.sqrt(max(v, 1e-300)) for v in found.power.values()]  # by the coefficient, whose square is the power
    G = np.column_stack([c * root for c, root in zip(columns, roots, strict=True)])
    names = list(found.power)
    if GAUSS_MARKOV in found.power:
        small, t_s = 1e-3, found.time_constant_s
        moved = spectrum.column(GAUSS_MARKOV, t_s * (1 + small)) - spectrum.column(GAUSS_MARKOV, t_s * (1 - small))
        G = np.column_stack([G, found.power[GAUSS_MARKOV] * moved / (2 * small * t_s)])
        names.append("time_constant_s")
    J = information(G, found.expected(spectrum), spectrum.freedom)
    scale = np.sqrt(np.diag(J))
    variance = np.diag(np.linalg.pinv(J / np.outer(scale, scale))) / scale**2
    return dict(zip(names, np.sqrt(variance).tolist(), strict=True))


def estimates(spectrum: Spectrum, found: Mixture) -> dict[str, tuple[float, float]]:
    """(coefficient, its standard uncertainty) of each process that was identified, and of a time constant.

    Slow noise that is there but too weak to be identified would bias what is, if it were taken to be zero. So both are
    means over all mixtures with some of the slow processes that were not identified, weighted by likelihood.

    Source  Hoeting, Madigan, Raftery and Volinsky, Statist. Sci. 14 (1999).
    """
    others = [name for name in DOUBTED if name not in found.power]
    chosen = [subset for k in range(len(others) + 1) for subset in combinations(others, k)]
    fits = [_fitted(spectrum, (*found.power, *subset), found.time_constant_s) for subset in chosen]
    fits = [fit for fit in fits if min(fit.power.values()) > 0] or [found]
    doubts = np.array([fit.log_likelihood - DOUBT * len(fit.power) / 2 for fit in fits])
    weights = np.exp(doubts - doubts.max())
    weights /= weights.sum()
    stds = [uncertainties(spectrum, fit) for fit in fits]
    out = {}
    names = [name for name in found.power if not _might_be_another(spectrum, found, name)]
    for name in (*names, *(("time_constant_s",) if GAUSS_MARKOV in names else ())):
        values = np.array([_value(fit, name) for fit in fits])
        mean = float(weights @ values)
        spread = np.array([each[name] for each in stds]) ** 2 + (values - mean) ** 2
        out[name] = mean, float(np.sqrt(weights @ spread))
    return out


def _might_be_another(spectrum: Spectrum, found: Mixture, name: str) -> bool:
    """Whether the others, with the slow ones that were left out, explain as much without this slow process."""
    others = tuple(each for each in dict.fromkeys((*found.power, *DOUBTED)) if each != name)
    if name not in DOUBTED:
        return False
    without = _fitted(spectrum, others, found.time_constant_s)
    return 2 * (found.log_likelihood - without.log_likelihood) < SURE


def _value(fit: Mixture, name: str) -> float:
    return float(np.sqrt(fit.power[name])) if name in fit.power else fit.time_constant_s


def bounded(spectrum: Spectrum, found: Mixture, name: str, time_constant_s: float = 0.0) -> tuple[float, float]:
    """(most likely, stays below with 95 %): the coefficient of a process that is not identified."""
    t_s = time_constant_s or found.time_constant_s
    others = tuple(each for each in dict.fromkeys((*found.power, *DOUBTED)) if each != name)
    column = spectrum.column(name, t_s)
    most = _fitted(spectrum, (*others, name), t_s)

    def loss(log_power: float) -> float:
        rest = _fitted(spectrum, others, t_s, np.exp(log_power) * column)
        return 2 * (most.log_likelihood - rest.log_likelihood) - BOUND

    weight = column / found.expected(spectrum)
    low = float(np.log(max(most.power[name], 1e-3 / np.sqrt(np.sum(spectrum.freedom * weight**2)))))
    high = low + 1.0
    while loss(high) < 0:
        low, high = high, high + 1.0
    bound = brentq(loss, low, high, xtol=0.02) if loss(low) < 0 else low
    return float(np.sqrt(most.power[name])), float(np.exp(bound / 2))


def settled(found: Mixture) -> Mixture:
    """Without the zeros."""
    return replace(found, power={name: v for name, v in found.power.items() if v > 0})
