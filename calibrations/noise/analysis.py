"""The noise of a still record as `rig noise` reports it: coefficients with bounds, and their JSON document.

The processes, lines and disturbances are those of `search`, so that every command gives the same answer. A process that
is identified has the estimate of the final fit. Any other process has an upper bound by the profile likelihood, as in
the parameter tables of every command (`fit.upper_bound`), but beside slow noise that a model need not hold.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import chdtri

from calibrations.criteria import COVERAGE, INTERVAL_STDS, SPOILT_BY
from calibrations.effects.catalogue import catalogue
from calibrations.effects.effect import Effect
from calibrations.model import Estimate
from calibrations.model.file import read_model
from calibrations.noise.comparison import deviation
from calibrations.noise.deviations import OCTAVE_KINDS, OVERLAPPING, DeviationCurve
from calibrations.noise.doubts import MISFITS, Disturbance, disturbance_document, disturbances
from calibrations.noise.fit import upper_bound
from calibrations.noise.likelihood import ChannelFit
from calibrations.noise.lines import SpectralLine
from calibrations.noise.record import Channel, Still
from calibrations.noise.samples import CONSTANT, WILD, HiddenNoise, hidden_in
from calibrations.noise.search import Search, search
from calibrations.result import Result
from calibrations.table import Array

Document = dict[str, Any]
MODEL = "still"  # the search begins with white noise alone
ORDER = (
    "white-noise", "flicker-noise", "rate-random-walk", "quantisation-noise", "sinusoidal-noise", "gauss-markov-noise",
)  # fmt: skip
SLOW = ("flicker-noise", "rate-random-walk")  # a weak one may be present beside any process, and widens its bound
SPOILT = {WILD: ("white-noise", "quantisation-noise")}  # wild samples change fast noise alone


@dataclass(frozen=True)
class Coefficient:
    """One process: its estimate and standard uncertainty.

    A process that is not identified may be absent; it is below `upper` with 95 %, infinite where nothing is known.
    `alternatives` are processes that would explain the record as well. Flicker noise and a random walk that cannot be
    separated are not identified: a coefficient of the wrong one of them means nothing. A Gauss-Markov process has a
    time constant, a sinusoid a frequency.
    """

    value: float
    std: float
    unit: str
    upper: float | None = None
    time_constant_s: float | None = None
    frequency_hz: float | None = None
    alternatives: tuple[str, ...] = ()

    @property
    def identified(self) -> bool:
        return self.upper is None


@dataclass(frozen=True)
class ChannelNoise:
    """One channel: its deviations as recorded, and its fit without the disturbances that could be removed."""

    search: Search
    fit: ChannelFit
    deviations: Mapping[str, DeviationCurve]  # by kind, of the record as it is

    @property
    def channel(self) -> Channel:
        return self.fit.channel

    @property
    def axis(self) -> str:
        return self.channel.axis

    @property
    def unit(self) -> str:
        return self.channel.unit

    @property
    def allan(self) -> DeviationCurve:
        """The overlapping Allan deviation of the record without any correction."""
        return self.deviations[OVERLAPPING]

    @property
    def cleaned_allan(self) -> DeviationCurve:
        """The Allan deviation without the disturbances that were removed."""
        return self.search.still.allan[self.axis]

    @property
    def lines(self) -> tuple[SpectralLine, ...]:
        """Sinusoids, strongest first."""
        return self.fit.lines

    @cached_property
    def coefficients(self) -> dict[str, Coefficient]:
        """Every process of the catalogue by its name."""
        effects = self.search.effects
        names = (*(name for name in ORDER if name in effects), *(name for name in effects if name not in ORDER))
        return {name: self._coefficient(effects[name]) for name in names}

    def modelled(self, tau_s: Array) -> Array:
        """Allan deviation that the processes and lines expect, shape of `tau_s`."""
        return deviation(self.fit, tau_s)

    def power(self, effect: Effect) -> float:
        """Square of an effect's fitted coefficient."""
        return self.fit.values[effect.name][effect.parameters[0].name] ** 2

    @property
    def interval(self) -> tuple[Array, Array]:
        """Bounds (b,) between which the true densities lie with a probability of COVERAGE each."""
        tail, freedom = (1 - COVERAGE) / 2, self.fit.freedom
        low, high = (self.fit.density * freedom / chdtri(freedom, p) for p in (tail, 1 - tail))
        return low, high

    def _coefficient(self, effect: Effect) -> Coefficient:
        hidden_noise = hidden_in(self.channel.oddities)
        unit = effect.parameters[0].unit.replace("{out}", self.unit)
        if hidden_noise is not None and hidden_noise.hides(effect.name):
            return _below_step(hidden_noise, effect.name, unit)
        if "lines" in effect.places:
            return self._sinusoid(unit)
        rivals = self.search.rivals.get(effect.name, ())
        strength, *shape = self._estimates(effect) or (None,)
        if strength and strength.identified and not (effect.name in SLOW and set(rivals) & set(SLOW)):
            time_s = shape[0].value if shape else None
            return Coefficient(strength.value, strength.std or 0.0, unit, None, time_s, None, rivals)
        value, upper, values = upper_bound(self.fit, effect, self._companions(effect))
        time_s = next(iter(list(values.values())[1:]), None)
        return Coefficient(value, (upper - value) / INTERVAL_STDS, unit, upper, time_s, None, rivals)

    def _estimates(self, effect: Effect) -> list[Estimate]:
        """Estimates of an effect's parameters in this channel; empty for an effect that is not in the fit."""
        return [estimate for estimate in self.search.end.model.estimates(effect.name) if estimate.axis == self.axis]

    def _companions(self, effect: Effect) -> list[Effect]:
        """The other processes of the fit, and those that may be present in addition."""
        slow = [self.search.effects[name] for name in SLOW if name in self.search.effects]
        processes = (*self.fit.effects, *(process for process in slow if process not in self.fit.effects))
        return [process for process in processes if process is not effect]

    def _sinusoid(self, unit: str) -> Coefficient:
        if not self.lines:
            return Coefficient(0.0, self.fit.line_bound / INTERVAL_STDS, unit, self.fit.line_bound)
        line = self.lines[0]
        return Coefficient(line.amplitude, line.std, unit, None, None, line.frequency_hz)


@dataclass(frozen=True, repr=False)
class NoiseAnalysis(Result):
    """The noise of a still record: `record` as it was read, and the search on it."""

    record: Still
    search: Search

    @cached_property
    def channels(self) -> dict[str, ChannelNoise]:
        """Channels by axis, without the disturbances that could be removed."""
        return _channels(self.record, self.search)

    @cached_property
    def uncleaned(self) -> dict[str, ChannelNoise] | None:
        """Channels by axis, with the disturbances; None where none was removed."""
        return _channels(self.record, self.search.uncleaned) if self.search.uncleaned is not None else None

    @cached_property
    def disturbances(self) -> tuple[Disturbance, ...]:
        return disturbances(self.search)

    def records(self) -> list[Document]:
        """A row a process of each channel."""
        processes = [
            (axis, coefficient) for axis, noise in self.channels.items() for coefficient in noise.coefficients.items()
        ]
        return [{"axis": axis, "process": name, **_coefficient(coefficient)} for axis, (name, coefficient) in processes]

    def spoils(self, disturbance: Disturbance) -> tuple[str, ...]:
        """The coefficients that a disturbance changes, or would change if it were not removed."""
        cleaned = self.channels[disturbance.axis].coefficients
        identified = tuple(name for name, coefficient in cleaned.items() if coefficient.identified)
        if disturbance.pattern is not None and self.uncleaned is not None:
            uncleaned = self.uncleaned[disturbance.axis].coefficients
            return tuple(name for name in cleaned if _differ(uncleaned[name], cleaned[name]))
        if disturbance.kind in (*MISFITS, CONSTANT):
            return identified
        return tuple(name for name in identified if name in SPOILT.get(disturbance.kind, ()))


def analyse(still: Still) -> NoiseAnalysis:
    """The noise of every channel of a still record."""
    return NoiseAnalysis(still, search(still, read_model(MODEL), catalogue()))


def _channels(record: Still, search: Search) -> dict[str, ChannelNoise]:
    return {
        fit.channel.axis: ChannelNoise(search, fit, record.deviations[fit.channel.axis]) for fit in search.end.channels
    }


def _below_step(hidden_noise: HiddenNoise, name: str, unit: str) -> Coefficient:
    """The bound on a process if the noise is below one step of the converter."""
    upper = hidden_noise.white_below if name == "white-noise" else np.inf
    return Coefficient(0.0, upper / INTERVAL_STDS, unit, upper)


def _differ(uncleaned: Coefficient, cleaned: Coefficient) -> bool:
    if uncleaned.identified != cleaned.identified:
        return True
    return uncleaned.identified and abs(cleaned.value - uncleaned.value) > SPOILT_BY * uncleaned.std


# The JSON document of a noise analysis.


def noise_document(analysis: NoiseAnalysis) -> Document:
    """`rig.noise/1`. The fields on deviations, spectrum and coefficients are those of the first channel.

    `allan` is the overlapping Allan deviation of the record as it is, `deviations` holds the other kinds, all with
    intervals of 95 %; `spectrum` is two-sided, without lines. `coefficients` are those without the disturbances that
    could be removed; `coefficients_without` repeats them where one was. `channels` has all channels by axis.
    """
    channels = {axis: _channel(channel) for axis, channel in analysis.channels.items()}
    first = next(iter(channels.values()))
    return {
        "schema": "rig.noise/1",
        "rate_hz": analysis.record.rate_hz,
        "n": analysis.record.n,
        "unit": analysis.record.unit,
        **first,
        "disturbances": [
            disturbance_document(disturbance) | {"spoils": list(analysis.spoils(disturbance))}
            for disturbance in analysis.disturbances
        ],
        "coefficients_without": first["coefficients"] if analysis.search.patterns else None,
        "channels": channels,
    }


def _channel(noise: ChannelNoise) -> Document:
    order = noise.fit.frequency_hz.argsort()
    low, high = noise.interval
    bands = {
        "frequency_hz": noise.fit.frequency_hz, "density": noise.fit.density, "low": low, "high": high,
        "model": noise.fit.expected,
    }  # fmt: skip
    return {
        "allan": _curve(noise.allan),
        "deviations": {kind: _curve(noise.deviations[kind]) for kind in OCTAVE_KINDS if kind != OVERLAPPING},
        "spectrum": {name: values[order].tolist() for name, values in bands.items()} | {"unit": f"({noise.unit})^2/Hz"},
        "lines": [{"frequency_hz": line.frequency_hz, "amplitude": line.amplitude} for line in noise.lines],
        "coefficients": {name: _coefficient(coefficient) for name, coefficient in noise.coefficients.items()},
    }


def _curve(curve: DeviationCurve) -> dict[str, list[float]]:
    columns = {"tau_s": curve.tau_s, "deviation": curve.deviation, "low": curve.low, "high": curve.high}
    return {name: values.tolist() for name, values in columns.items()}


def _coefficient(coefficient: Coefficient) -> Document:
    """Value, uncertainty, unit, whether it is identified; and those of the other fields that it has."""
    fields = {name: value for name, value in asdict(coefficient).items() if value is not None}
    unknown = {name: None for name in ("std", "upper") if np.isinf(fields.get(name, 0.0))}
    return {**fields, **unknown, "alternatives": list(coefficient.alternatives), "identified": coefficient.identified}
