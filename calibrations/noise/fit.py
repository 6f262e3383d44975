"""A noise model fitted to a still record: coefficients of every channel by Whittle's likelihood, with uncertainties.

The spectrum is linear in the squares of the effects' strengths, which `maximise` finds. The shape of an effect (a time
constant) is searched on a grid and refined. Lines are found before, one after another.

An effect is identified in a channel if the fit without it loses more than criteria.IDENTIFIED of twice the
log-likelihood. Otherwise it may be absent, and an upper bound is given.

Uncertainties follow from Fisher's information on all parameters together. Where the model does not describe the
spectrum, the Birge ratio widens them. Uncertainties of a line are those of Rife and Boorstyn.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar

from calibrations.criteria import IDENTIFIED, INTERVAL_STDS
from calibrations.effects import Effect
from calibrations.errors import ModelError
from calibrations.model import Estimate, Model, Term
from calibrations.noise.channel_spectrum import Line, Lines, bands, strongest_line
from calibrations.noise.likelihood import ChannelFit, Values, effect_spectrum, information, maximise
from calibrations.noise.record import Channel, Still
from calibrations.noise.samples import hidden_in
from calibrations.table import Array

ONE_SIDED_STDS = 1.645  # standard deviations of a one-sided bound of 95 %
DERIVATIVE_STEP = 1e-3  # of a value, for the derivative


def estimates(found: ChannelFit, effect: Effect, unit: str) -> Iterator[Estimate]:
    """Of one effect's parameters, in the order in which they are declared."""
    seen = _line_estimates(found, unit) if "lines" in effect.places else _spectrum_estimates(found, effect, unit)
    hidden = hidden_in(found.channel.oddities)
    if hidden is None or not hidden.hides(effect.name):
        yield from seen
        return
    why = f"the noise is below the converter's step of {hidden.step:.4g} {unit}"
    for each in seen:
        yield replace(each, std=None, identified=False, why=why)


def _spectrum_estimates(found: ChannelFit, effect: Effect, unit: str) -> Iterator[Estimate]:
    strength, values, axis = effect.parameters[0], found.values[effect.name], found.channel.axis
    power, deviations = values[strength.name] ** 2, power_deviations(found)
    of_power = deviations[effect.name, strength.name]
    identified = gain_of(found, effect) > IDENTIFIED
    below = float(np.sqrt(power + ONE_SIDED_STDS * of_power))
    for p in effect.parameters:
        own = p.unit.replace("{out}", unit)
        if not identified:
            why = f"this record does not tell it from none; {strength.name} is below {below:.2g} {own}"
            std = below / ONE_SIDED_STDS if p is strength else None
            yield Estimate(p.name, axis, values[p.name], std, own, False, why if p is strength else "there may be none")
        elif p is strength:
            yield Estimate(p.name, axis, values[p.name], of_power / (2 * values[p.name]), own)
        else:
            yield Estimate(p.name, axis, values[p.name], deviations[effect.name, p.name], own)


def gain_of(found: ChannelFit, effect: Effect) -> float:
    """Twice the log-likelihood that a channel's fit loses without one of its effects, the others refitted.

    Divided by the squared excess where the model does not describe the spectrum, as uncertainties are widened there.
    """
    if found.values[effect.name][effect.parameters[0].name] == 0:
        return 0.0
    rest = [other for other in found.effects if other is not effect]
    if not rest:
        return np.inf
    lost = 2 * (found.log_likelihood - fit_effects(found, rest).log_likelihood)
    return float(lost / max(1.0, found.excess) ** 2)


def power_deviations(found: ChannelFit) -> dict[tuple[str, str], float]:
    """Standard deviation of each strength's square and of each shape, by (effect, parameter)."""
    columns: dict[tuple[str, str], Array] = {}
    for effect in found.effects:
        strength, values = effect.parameters[0].name, found.values[effect.name]
        columns[effect.name, strength] = effect_spectrum(effect, found.parts, {**values, strength: 1.0})
        for p in effect.parameters[1:]:
            step = DERIVATIVE_STEP * values[p.name]
            ahead, behind = ({**values, p.name: values[p.name] + side * step} for side in (1, -1))
            columns[effect.name, p.name] = (found.part_of(effect, ahead) - found.part_of(effect, behind)) / (2 * step)
    J = information(np.column_stack(list(columns.values())), found.expected, found.freedom)
    scale = np.sqrt(np.maximum(np.diag(J), np.finfo(float).tiny))
    variance = np.diag(np.linalg.pinv(J / np.outer(scale, scale))) / scale**2
    wider = max(1.0, found.excess)
    return dict(zip(columns, (wider * np.sqrt(variance)).tolist(), strict=True))


def _line_estimates(found: ChannelFit, unit: str) -> Iterator[Estimate]:
    axis = found.channel.axis
    for k, line in enumerate(found.lines, 1):
        yield Estimate(f"amplitude_{k}", axis, float(line.amplitude), float(line.std), unit)
        yield Estimate(f"frequency_{k}", axis, float(line.frequency_hz), float(line.std_hz), "Hz")
    if not found.lines:
        why = f"no line stands out; one of less than {found.line_bound:.2g} {unit} would not"
        yield Estimate("amplitude_1", axis, 0.0, float(found.line_bound / INTERVAL_STDS), unit, False, why)


# A noise model fitted to a still record: coefficients of every channel by Whittle's likelihood, with uncertainties.
#
# The spectrum is linear in the squares of the effects' strengths, which are found by `whittle.maximise`; the shape of
# an
# effect that has one (a time constant) is searched for. Lines are found first, one after another.

ROUNDS = 2  # over the shapes, where a model has several


@dataclass(frozen=True)
class NoiseFit:
    """A noise model beside a still record. `model` has the values; a channel each."""

    still: Still
    model: Model
    channels: tuple[ChannelFit, ...]

    @property
    def measured(self) -> Still:
        """The record, for provenance."""
        return self.still

    @property
    def log_likelihood(self) -> float:
        """Of all channels."""
        return sum(each.log_likelihood for each in self.channels)

    @property
    def pooled_excess(self) -> float:
        """The excess over all channels together."""
        return float(np.sqrt(np.mean([each.excess**2 for each in self.channels])))

    @cached_property
    def held_out_excess(self) -> float:
        """Pooled excess on each half of the record with the model fitted to the other half."""
        effects = tuple(term.effect for term in noise_terms(self.model))
        each = [_excess_on_other(pair, effects) for c in self.still.channels for pair in (c.halves(), c.halves()[::-1])]
        return float(np.sqrt(np.mean(np.square(each))))

    def share_left(self, start: NoiseFit) -> float:
        """Part of the excess variance of `start` that this fit does not explain; all of it where there is none."""
        excess = start.pooled_excess**2 - 1
        return (self.pooled_excess**2 - 1) / excess if excess > 0 else 1.0


def _excess_on_other(halves: tuple[Channel, Channel], effects: Sequence[Effect]) -> float:
    """Excess on the second half with the fit to the first; lines have the phase there that fits."""
    known, other = halves
    found = fit_channel(known, effects)
    there = without_effects(other, found.lines)
    return ChannelFit(other, there.parts, found.lines, found.effects, found.values).excess


def noise_terms(model: Model) -> tuple[Term, ...]:
    """The model's effects of noise. Raises ModelError where it has none."""
    terms = tuple(term for term in model.terms if term.effect.is_noise)
    if not terms:
        raise ModelError(
            f"{model.name}: none of its effects is noise, and a still record shows noise alone; "
            "take the model still, or one that began with it"
        )
    return terms


def fit(model: Model, still: Still) -> NoiseFit:
    """The model with its coefficients estimated from the record. Raises ModelError for one without noise."""
    effects = tuple(term.effect for term in noise_terms(model))
    return noise_fit(model, still, tuple(fit_channel(channel, effects) for channel in still.channels))


def noise_fit(model: Model, still: Still, channels: tuple[ChannelFit, ...]) -> NoiseFit:
    """The fit of all channels as one value, its estimates in the model."""
    terms = tuple(
        Term(term.effect, estimates=tuple(e for each in channels for e in estimates(each, term.effect, still.unit)))
        for term in noise_terms(model)
    )
    return NoiseFit(still, replace(model, terms=terms, unit=still.unit), channels)


def fit_channel(channel: Channel, effects: Sequence[Effect]) -> ChannelFit:
    """Effects fitted to one channel; lines are looked for where one of the effects has them."""
    smooth = tuple(effect for effect in effects if "spectrum" in effect.places)
    most = most_lines(effects)
    if not most:
        return fit_effects(without_effects(channel), smooth)
    lines, bound = find_lines(channel, smooth, most)
    return replace(fit_effects(without_effects(channel, lines), smooth), line_bound=bound)


def most_lines(effects: Iterable[Effect]) -> int:
    """How many lines the effects can hold."""
    return sum(len(effect.parameters) // 2 for effect in effects if "lines" in effect.places)


def find_lines(channel: Channel, beside: Sequence[Effect], most: int) -> tuple[Lines, float]:
    """(lines that stand out above the effects' spectrum, strongest first; the amplitude that one more might have)."""
    lines: list[Line] = []
    while True:
        present = fit_effects(without_effects(channel, lines), beside)
        found = strongest_line(channel, tuple(lines), present.level)
        if isinstance(found, float) or len(lines) == most:
            bound = found if isinstance(found, float) else found.amplitude
            return tuple(sorted(lines, key=lambda line: -line.amplitude)), bound
        lines.append(found)


def without_effects(channel: Channel, lines: Iterable[Line] = ()) -> ChannelFit:
    """One channel's spectrum less given lines, beside nothing."""
    lines = tuple(lines)
    return ChannelFit(channel, bands(channel, lines), lines, (), {})


def fit_effects(start: ChannelFit, effects: Sequence[Effect]) -> ChannelFit:
    """Effects with a spectrum fitted to what is seen."""
    if not effects:
        return start
    at = replace(start, effects=tuple(effects), values={})
    shapes: dict[str, Values] = {effect.name: _first_shape(effect, at.channel) for effect in effects}
    bent = [effect for effect in effects if shapes[effect.name]]
    for _ in range(ROUNDS if len(bent) > 1 else 1):
        for effect in bent:
            shapes[effect.name] = _best_shape(at, effect, shapes)
    return replace(at, values=_best_strengths(at, shapes)[0])


def _first_shape(effect: Effect, channel: Channel) -> Values:
    """Where the search for an effect's shape begins: its parameters but the first."""
    return {p.name: float(np.median(shape_grid(effect, p.name, channel))) for p in effect.parameters[1:]}


def shape_grid(effect: Effect, name: str, channel: Channel) -> Array:
    """Values of a shape that are tried, in order: those that the record can show."""
    guess = next(p.guess for p in effect.parameters if p.name == name)
    if guess is None:
        raise ModelError(f"{effect.name}: the parameter {name} of a noise effect needs a guess")
    return np.asarray(guess(channel))


def _best_strengths(at: ChannelFit, shapes: Mapping[str, Values]) -> tuple[dict[str, Values], float]:
    """(values of all effects, log-likelihood) of the most likely strengths for given shapes."""
    columns = [
        effect_spectrum(effect, at.parts, {effect.parameters[0].name: 1.0, **shapes[effect.name]})
        for effect in at.effects
    ]
    power, value = maximise(np.column_stack(columns), at.seen, at.freedom, np.zeros(len(at.seen)))
    values = {
        effect.name: {effect.parameters[0].name: float(np.sqrt(v)), **shapes[effect.name]}
        for effect, v in zip(at.effects, power, strict=True)
    }
    return values, float(value)


def _best_shape(at: ChannelFit, effect: Effect, shapes: Mapping[str, Values]) -> Values:
    """The most likely shape of one effect beside the others."""
    name = effect.parameters[1].name

    def loss(log_value: float) -> float:
        return -_best_strengths(at, {**shapes, effect.name: {name: float(np.exp(log_value))}})[1]

    logs = np.log(shape_grid(effect, name, at.channel))
    best = int(np.argmin([loss(value) for value in logs]))
    ends = logs[max(0, best - 1)], logs[min(len(logs) - 1, best + 1)]
    if ends[0] == ends[1]:
        return {name: float(np.exp(ends[0]))}
    found = minimize_scalar(loss, bounds=ends, method="bounded", options={"xatol": 0.02})
    return {name: float(np.exp(found.x))}
