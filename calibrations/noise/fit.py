"""A noise model fitted to a still record: coefficients of every channel by Whittle's likelihood, with uncertainties.

The spectrum is linear in the squares of the effects' strengths, which `maximise` finds. The shape of an effect (a time
constant) is searched on a grid and refined. Lines are found before, one after another.

An effect is identified in a channel if the fit without it loses more than criteria.IDENTIFIED of twice the
log-likelihood. Otherwise it may be absent, and has an upper bound by the profile likelihood.

Uncertainties follow from Fisher's information on all parameters together. Where the model does not describe the
spectrum, the Birge ratio widens them. Uncertainties of a line are those of Rife and Boorstyn.

Source  Cox and Hinkley, Theoretical Statistics, 7.2: intervals from the profile likelihood.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from calibrations.criteria import IDENTIFIED, INTERVAL_STDS
from calibrations.effects import Effect
from calibrations.errors import ModelError
from calibrations.model import Estimate, Model, Term
from calibrations.noise.likelihood import (
    ChannelFit,
    Values,
    effect_spectrum,
    information,
    log_likelihood,
    maximise,
    maximise_from,
    profile,
    unit_spectrum,
)
from calibrations.noise.lines import SpectralLine, bands, strongest_line
from calibrations.noise.record import Channel, Still
from calibrations.noise.samples import hidden_in
from calibrations.noise.signal import signal_terms, without_signal
from calibrations.table import Array

DERIVATIVE_STEP = 1e-3  # of a value, for the derivative


Deviations = Mapping[tuple[str, str], float]  # of each strength's square and of each shape, by effect and parameter


def estimates(fit: ChannelFit, effect: Effect, unit: str, deviations: Deviations) -> Iterator[Estimate]:
    """Estimates of one effect's parameters, in the order in which they are declared."""
    lines = "lines" in effect.places
    values = _line_estimates(fit, unit) if lines else _spectrum_estimates(fit, effect, unit, deviations)
    hidden_noise = hidden_in(fit.channel.oddities)
    if hidden_noise is None or not hidden_noise.hides(effect.name):
        yield from values
        return
    reason = f"the noise is below the converter's step of {hidden_noise.step:.4g} {unit}"
    for estimate in values:
        yield replace(estimate, std=None, identified=False, why=reason)


def _spectrum_estimates(fit: ChannelFit, effect: Effect, unit: str, deviations: Deviations) -> Iterator[Estimate]:
    strength, values, axis = effect.parameters[0], fit.values[effect.name], fit.channel.axis
    of_power = deviations[effect.name, strength.name]
    if gain_of(fit, effect) <= IDENTIFIED:
        yield from _estimate_bounds(fit, effect, unit)
        return
    for p in effect.parameters:
        value = values[p.name]
        std = of_power / (2 * value) if p is strength else deviations[effect.name, p.name]
        yield Estimate(p.name, axis, value, std, p.unit.replace("{out}", unit))


def _estimate_bounds(fit: ChannelFit, effect: Effect, unit: str) -> Iterator[Estimate]:
    """A process that may be absent: the bound of its strength; its shape means nothing."""
    strength, values, axis = effect.parameters[0], fit.values[effect.name], fit.channel.axis
    value, bound, _ = upper_bound(fit, effect, [e for e in fit.effects if e is not effect])
    strength_unit = strength.unit.replace("{out}", unit)
    reason = f"the process may be absent: {strength.name} is below {bound:.2g} {strength_unit} (95 %)"
    yield Estimate(strength.name, axis, value, (bound - value) / INTERVAL_STDS, strength_unit, False, reason)
    for p in effect.parameters[1:]:
        yield Estimate(p.name, axis, values[p.name], None, p.unit, False, "the process may be absent")


def gain_of(fit: ChannelFit, effect: Effect) -> float:
    """Twice the log-likelihood that a channel's fit loses without one of its effects, the others refitted.

    Divided by the squared excess where the model does not describe the spectrum, as uncertainties are widened there.
    """
    if fit.values[effect.name][effect.parameters[0].name] == 0:
        return 0.0
    remaining = [e for e in fit.effects if e is not effect]
    if not remaining:
        return np.inf
    loss = 2 * (fit.log_likelihood - fit_effects(fit, remaining).log_likelihood)
    return float(loss / max(1.0, fit.excess) ** 2)


def upper_bound(
    fit: ChannelFit, effect: Effect, other_effects: Sequence[Effect]
) -> tuple[float, float, dict[str, float]]:
    """(most likely coefficient, its upper bound with 95 %, all its parameters), the other effects refitted.

    At the bound, twice the log-likelihood is criteria.IDENTIFIED below its maximum, times the squared excess where the
    model does not describe the spectrum.
    """
    likeliest = fit_effects(fit, (*other_effects, effect))
    threshold = IDENTIFIED * max(1.0, fit.excess) ** 2
    column, *columns = (unit_spectrum(e, fit.parts, _shape(e, likeliest)) for e in (effect, *other_effects))
    power = likeliest.values[effect.name][effect.parameters[0].name] ** 2
    G = np.column_stack(columns) if columns else None
    start = np.array([likeliest.values[e.name][e.parameters[0].name] ** 2 for e in other_effects])

    def loss(log_power: float) -> float:
        base = np.exp(log_power) * column
        if G is None:
            value = log_likelihood(base, fit.density, fit.freedom)
        else:
            value = maximise_from(start.copy(), G, fit.density, fit.freedom, base)[1]
        return 2 * (likeliest.log_likelihood - float(value)) - threshold

    weight = column / likeliest.expected
    low = float(np.log(max(power, 1e-3 / np.sqrt(np.sum(fit.freedom * weight**2)))))
    high = low + 1.0
    while loss(high) < 0:
        low, high = high, high + 1.0
    bound = float(brentq(loss, low, high, xtol=0.02)) if loss(low) < 0 else low
    return float(np.sqrt(power)), float(np.exp(bound / 2)), likeliest.values[effect.name]


def _shape(effect: Effect, fit: ChannelFit) -> Values:
    """The fitted parameters of an effect, except its strength."""
    return {p.name: fit.values[effect.name][p.name] for p in effect.parameters[1:]}


def power_covariance(fit: ChannelFit) -> tuple[list[tuple[str, str]], Array]:
    """The squares of strengths and the shapes, named as (effect, parameter), and their covariance (p, p)."""
    columns: dict[tuple[str, str], Array] = {}
    for effect in fit.effects:
        strength, values = effect.parameters[0].name, fit.values[effect.name]
        columns[effect.name, strength] = effect_spectrum(effect, fit.parts, {**values, strength: 1.0})
        for p in effect.parameters[1:]:
            step = DERIVATIVE_STEP * values[p.name]
            forward, backward = ({**values, p.name: values[p.name] + side * step} for side in (1, -1))
            columns[effect.name, p.name] = (fit.part_of(effect, forward) - fit.part_of(effect, backward)) / (2 * step)
    J = information(np.column_stack(list(columns.values())), fit.expected, fit.freedom)
    scale = np.sqrt(np.maximum(np.diag(J), np.finfo(float).tiny))
    wider = max(1.0, fit.excess)
    return list(columns), wider**2 * np.linalg.pinv(J / np.outer(scale, scale)) / np.outer(scale, scale)


def power_deviations(fit: ChannelFit) -> Deviations:
    """Standard deviation of each strength's square and of each shape, by (effect, parameter)."""
    names, matrix = power_covariance(fit)
    return dict(zip(names, np.sqrt(np.diag(matrix)).tolist(), strict=True))


def _line_estimates(fit: ChannelFit, unit: str) -> Iterator[Estimate]:
    axis = fit.channel.axis
    for k, line in enumerate(fit.lines, 1):
        yield Estimate(f"amplitude_{k}", axis, float(line.amplitude), float(line.std), unit)
        yield Estimate(f"frequency_{k}", axis, float(line.frequency_hz), float(line.std_hz), "Hz")
    if not fit.lines:
        reason = f"no line exceeds the noise; its amplitude is below {fit.line_bound:.2g} {unit}"
        yield Estimate("amplitude_1", axis, 0.0, float(fit.line_bound / INTERVAL_STDS), unit, False, reason)


ROUNDS = 2  # over the shapes, where a model has several


@dataclass(frozen=True)
class NoiseFit:
    """A noise model on a still record, channel by channel. `stated` has values where they are not fitted here."""

    still: Still
    stated: Model
    channels: tuple[ChannelFit, ...]
    fitted: bool = True

    @cached_property
    def model(self) -> Model:
        """The model with its values; uncertainties take as long as the fit."""
        if not self.fitted:
            return self.stated
        fits = [(pair, power_deviations(pair) if pair.effects else {}) for pair in self.channels]
        terms = tuple(
            Term(
                term.effect,
                estimates=tuple(e for pair in fits for e in estimates(pair[0], term.effect, self.still.unit, pair[1])),
            )
            if term.effect.is_noise
            else term
            for term in self.stated.terms
        )
        return replace(self.stated, terms=terms, unit=self.still.unit)

    @property
    def measured(self) -> Still:
        """The record, for provenance."""
        return self.still

    @property
    def log_likelihood(self) -> float:
        """Log-likelihood of all channels together."""
        return sum(channel.log_likelihood for channel in self.channels)

    @property
    def pooled_excess(self) -> float:
        """The excess over all channels together."""
        return float(np.sqrt(np.mean([channel.excess**2 for channel in self.channels])))

    @cached_property
    def held_out_excess(self) -> float:
        """Pooled excess on each half of the record with the model fitted to the other half."""
        effects = tuple(term.effect for term in noise_terms(self.stated))
        excesses = [
            _unseen_excess(pair, effects) for c in self.still.channels for pair in (c.halves(), c.halves()[::-1])
        ]
        return float(np.sqrt(np.mean(np.square(excesses))))

    def share_left(self, start: NoiseFit) -> float:
        """Part of the excess variance of `start` that this fit does not explain; all of it where there is none."""
        excess = start.pooled_excess**2 - 1
        return (self.pooled_excess**2 - 1) / excess if excess > 0 else 1.0


def _unseen_excess(halves: tuple[Channel, Channel], effects: Sequence[Effect]) -> float:
    """Excess on the second half with the fit to the first; lines have the phase there that fits."""
    fitted_half, unseen_half = halves
    fit = fit_channel(fitted_half, effects)
    spectrum = without_effects(unseen_half, fit.lines)
    return ChannelFit(unseen_half, spectrum.parts, fit.lines, fit.effects, fit.values).excess


def noise_terms(model: Model) -> tuple[Term, ...]:
    """The model's effects of noise. Raises ModelError where it has none."""
    terms = tuple(term for term in model.terms if term.effect.is_noise)
    if not terms:
        raise ModelError(
            f"{model.name}: none of its effects is noise, and a still record shows only noise; "
            "use the model still, or one made from it"
        )
    return terms


def fit(model: Model, still: Still) -> NoiseFit:
    """The model with its coefficients estimated from the record, after its signal terms are removed with their values.

    Raises ModelError for one without noise.
    """
    effects = tuple(term.effect for term in noise_terms(model))
    still = without_signal(still, signal_terms(model))
    return NoiseFit(still, model, tuple(fit_channel(channel, effects) for channel in still.channels))


def fit_channel(channel: Channel, effects: Sequence[Effect]) -> ChannelFit:
    """Effects fitted to one channel; lines are looked for where one of the effects has them."""
    smooth = tuple(effect for effect in effects if "spectrum" in effect.places)
    max_lines = line_capacity(effects)
    if not max_lines:
        return fit_effects(without_effects(channel), smooth)
    return fit_effects(find_lines(channel, smooth, max_lines), smooth)


def line_capacity(effects: Iterable[Effect]) -> int:
    """The number of lines that the effects can hold."""
    return sum(len(effect.parameters) // 2 for effect in effects if "lines" in effect.places)


def find_lines(channel: Channel, effects: Sequence[Effect], max_lines: int) -> ChannelFit:
    """The channel less the lines that exceed the effects' spectrum, strongest first, `max_lines` of them.

    `line_bound` is the amplitude that one more might have.
    """
    lines: list[SpectralLine] = []
    while True:
        remaining = without_effects(channel, lines)
        strongest = strongest_line(channel, tuple(lines), fit_effects(remaining, effects).level)
        if isinstance(strongest, float) or len(lines) == max_lines:
            bound = strongest if isinstance(strongest, float) else strongest.amplitude
            ordered = tuple(sorted(lines, key=lambda line: -line.amplitude))
            remaining = remaining if ordered == remaining.lines else without_effects(channel, ordered)
            return replace(remaining, line_bound=bound, fits={})
        lines.append(strongest)


def without_effects(channel: Channel, lines: Iterable[SpectralLine] = ()) -> ChannelFit:
    """One channel's spectrum less given lines, with no effect."""
    lines = tuple(lines)
    return ChannelFit(channel, bands(channel, lines), lines, (), {})


def fit_effects(start: ChannelFit, effects: Sequence[Effect]) -> ChannelFit:
    """Effects with a spectrum fitted to the measured densities; a search uses many of these fits again."""
    if not effects:
        return start
    names = frozenset(effect.name for effect in effects)
    if names not in start.fits:
        start.fits[names] = _fit_effects(replace(start, effects=tuple(effects), values={}), effects)
    return start.fits[names]


def _fit_effects(channel_fit: ChannelFit, effects: Sequence[Effect]) -> ChannelFit:
    bent = [effect for effect in effects if len(effect.parameters) > 1]
    grids = {effect.name: shape_grid(effect, effect.parameters[1].name, channel_fit.channel) for effect in bent}
    shapes: dict[str, Values] = {effect.name: {} for effect in effects}
    shapes |= {effect.name: {effect.parameters[1].name: float(np.median(grids[effect.name]))} for effect in bent}
    for _ in range(ROUNDS if len(bent) > 1 else 1):
        for effect in bent:
            shapes[effect.name] = _best_shape(channel_fit, effect, grids[effect.name], shapes)
    return replace(channel_fit, values=_best_strengths(channel_fit, shapes))


def shape_grid(effect: Effect, name: str, channel: Channel) -> Array:
    """Values of a shape that are tried, in order: those that the record can show."""
    guess = next(p.guess for p in effect.parameters if p.name == name)
    if guess is None:
        raise ModelError(f"{effect.name}: the parameter {name} of a noise effect needs a guess")
    return np.asarray(guess(channel))


def _best_strengths(channel_fit: ChannelFit, shapes: Mapping[str, Values]) -> dict[str, Values]:
    """Values of all effects with the most likely strengths for given shapes."""
    power, _ = maximise(
        _unit_columns(channel_fit, channel_fit.effects, shapes),
        channel_fit.density,
        channel_fit.freedom,
        np.zeros(len(channel_fit.density)),
    )
    return {
        effect.name: {effect.parameters[0].name: float(np.sqrt(v)), **shapes[effect.name]}
        for effect, v in zip(channel_fit.effects, power, strict=True)
    }


def _unit_columns(channel_fit: ChannelFit, effects: Sequence[Effect], shapes: Mapping[str, Values]) -> Array:
    """Spectra of effects for a strength of 1, shape (b, effects)."""
    return np.column_stack([unit_spectrum(effect, channel_fit.parts, shapes[effect.name]) for effect in effects])


def _best_shape(channel_fit: ChannelFit, effect: Effect, grid: Array, shapes: Mapping[str, Values]) -> Values:
    """The most likely shape of one effect, with the others held, near the best of a grid (g,)."""
    name = effect.parameters[1].name
    companions = [e for e in channel_fit.effects if e is not effect]
    G = (
        np.column_stack([_unit_columns(channel_fit, companions, shapes), channel_fit.density])
        if companions
        else channel_fit.density[:, None].copy()
    )
    spectra = np.array([unit_spectrum(effect, channel_fit.parts, {name: value}) for value in grid.tolist()])
    thetas, values = profile(G, spectra, channel_fit.density, channel_fit.freedom)
    best = int(np.argmax(values))
    logs = np.log(grid)
    ends = logs[max(0, best - 1)], logs[min(len(logs) - 1, best + 1)]
    if ends[0] == ends[1]:
        return {name: float(np.exp(ends[0]))}
    none = np.zeros(len(channel_fit.density))

    def loss(log_value: float) -> float:
        G[:, -1] = unit_spectrum(effect, channel_fit.parts, {name: float(np.exp(log_value))})
        return -float(maximise_from(thetas[best].copy(), G, channel_fit.density, channel_fit.freedom, none)[1])

    optimum = minimize_scalar(loss, bounds=ends, method="bounded", options={"xatol": 0.02})
    return {name: float(np.exp(optimum.x))}
