"""A noise model fitted to a still record: coefficients of every channel by Whittle's likelihood, with uncertainties.

The spectrum is linear in the squares of the effects' strengths, which are found by `whittle.maximise`; the shape of an
effect that has one (a time constant) is searched for. Lines are found first, one after another.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from calibrations.effect import Effect
from calibrations.errors import ModelError
from calibrations.model import Model, Term
from calibrations.noise_analysis.lines import Line
from calibrations.noise_analysis.whittle import maximise
from calibrations.still.bands import Lines, bands, strongest
from calibrations.still.channel_fit import ChannelFit, Values, spectrum_of
from calibrations.still.estimates import estimates
from calibrations.still.record import Channel, Still
from calibrations.table import Array

ROUNDS = 2  # over the shapes, where a model has several


@dataclass(frozen=True)
class NoiseFit:
    """A noise model beside a still record. `model` has the values; a channel each."""

    still: Still
    model: Model
    channels: tuple[ChannelFit, ...]

    @property
    def log_likelihood(self) -> float:
        """Of all channels."""
        return sum(each.log_likelihood for each in self.channels)

    @property
    def pooled_excess(self) -> float:
        """The excess over all channels together."""
        return float(np.sqrt(np.mean([each.excess**2 for each in self.channels])))


def noise_terms(model: Model) -> tuple[Term, ...]:
    """The model's effects of noise. Raises ModelError where it has none."""
    terms = tuple(term for term in model.terms if "still" in term.effect.kinds)
    if not terms:
        raise ModelError(
            f"{model.name}: none of its effects is noise, and a still record shows noise alone; "
            "take the model still, or one that began with it"
        )
    return terms


def fit(model: Model, still: Still) -> NoiseFit:
    """The model with its coefficients estimated from the record. Raises ModelError for one without noise."""
    effects = tuple(term.effect for term in noise_terms(model))
    return fitted(model, still, tuple(fit_channel(channel, effects) for channel in still.channels))


def fitted(model: Model, still: Still, channels: tuple[ChannelFit, ...]) -> NoiseFit:
    """The fit of all channels as one value, its estimates in the model."""
    terms = tuple(
        Term(term.effect, estimates=tuple(e for each in channels for e in estimates(each, term.effect, still.unit)))
        for term in noise_terms(model)
    )
    return NoiseFit(still, replace(model, terms=terms, unit=still.unit), channels)


def fit_channel(channel: Channel, effects: Sequence[Effect]) -> ChannelFit:
    """Effects fitted to one channel; lines are looked for where one of the effects has them."""
    smooth = tuple(effect for effect in effects if effect.spectrum is not None)
    most = most_lines(effects)
    if not most:
        return with_effects(seen(channel), smooth)
    lines, bound = lines_of(channel, smooth, most)
    return replace(with_effects(seen(channel, lines), smooth), line_bound=bound)


def most_lines(effects: Iterable[Effect]) -> int:
    """How many lines the effects can hold."""
    return sum(len(effect.parameters) // 2 for effect in effects if effect.lines is not None)


def lines_of(channel: Channel, beside: Sequence[Effect], most: int) -> tuple[Lines, float]:
    """(lines that stand out above the effects' spectrum, strongest first; the amplitude that one more might have)."""
    lines: list[Line] = []
    while True:
        present = with_effects(seen(channel, lines), beside)
        found = strongest(channel, tuple(lines), present.level)
        if isinstance(found, float) or len(lines) == most:
            bound = found if isinstance(found, float) else found.amplitude
            return tuple(sorted(lines, key=lambda line: -line.amplitude)), bound
        lines.append(found)


def seen(channel: Channel, lines: Iterable[Line] = ()) -> ChannelFit:
    """One channel's spectrum less given lines, beside nothing."""
    lines = tuple(lines)
    return ChannelFit(channel, bands(channel, lines), lines, (), {})


def with_effects(start: ChannelFit, effects: Sequence[Effect]) -> ChannelFit:
    """Effects with a spectrum fitted to what is seen."""
    if not effects:
        return start
    at = replace(start, effects=tuple(effects), values={})
    shapes: dict[str, Values] = {effect.name: _shape(effect, at.channel) for effect in effects}
    bent = [effect for effect in effects if shapes[effect.name]]
    for _ in range(ROUNDS if len(bent) > 1 else 1):
        for effect in bent:
            shapes[effect.name] = _searched(at, effect, shapes)
    return replace(at, values=_strengths(at, shapes)[0])


def _shape(effect: Effect, channel: Channel) -> Values:
    """Where the search for an effect's shape begins: its parameters but the first."""
    return {p.name: float(np.median(tried(effect, p.name, channel))) for p in effect.parameters[1:]}


def tried(effect: Effect, name: str, channel: Channel) -> Array:
    """Values of a shape that are tried, in order: those that the record can show."""
    if name not in effect.starts:
        raise ModelError(f"{effect.name}: a noise effect's {name} needs a function in STARTS")
    return np.asarray(effect.starts[name](channel))  # type: ignore[arg-type] # of a noise effect: of a channel


def _strengths(at: ChannelFit, shapes: Mapping[str, Values]) -> tuple[dict[str, Values], float]:
    """(values of all effects, log-likelihood) of the most likely strengths for given shapes."""
    columns = [
        spectrum_of(effect, at.parts, {effect.parameters[0].name: 1.0, **shapes[effect.name]}) for effect in at.effects
    ]
    power, value = maximise(np.column_stack(columns), at.seen, at.freedom, np.zeros(len(at.seen)))
    values = {
        effect.name: {effect.parameters[0].name: float(np.sqrt(v)), **shapes[effect.name]}
        for effect, v in zip(at.effects, power, strict=True)
    }
    return values, float(value)


def _searched(at: ChannelFit, effect: Effect, shapes: Mapping[str, Values]) -> Values:
    """The most likely shape of one effect beside the others."""
    name = effect.parameters[1].name

    def loss(log_value: float) -> float:
        return -_strengths(at, {**shapes, effect.name: {name: float(np.exp(log_value))}})[1]

    logs = np.log(tried(effect, name, at.channel))
    best = int(np.argmin([loss(value) for value in logs]))
    ends = logs[max(0, best - 1)], logs[min(len(logs) - 1, best + 1)]
    if ends[0] == ends[1]:
        return {name: float(np.exp(ends[0]))}
    found = minimize_scalar(loss, bounds=ends, method="bounded", options={"xatol": 0.02})
    return {name: float(np.exp(found.x))}
