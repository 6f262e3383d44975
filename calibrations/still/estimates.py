"""What a channel's fit says of each parameter: its value and standard uncertainty, or that it may as well be nothing.

Uncertainties follow from Fisher's information on all parameters together, widened by the Birge ratio where the model
does not describe the spectrum. Those of a line are Rife and Boorstyn's.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from calibrations.effect import Effect
from calibrations.model import Estimate
from calibrations.noise_analysis.oddities import hidden_in
from calibrations.noise_analysis.whittle import information
from calibrations.still.channel_fit import ChannelFit, spectrum_of
from calibrations.table import Array

STEP = 1e-3  # of a value, for the derivative
BOUND = 1.645  # standard deviations below which a power is with 95 %
SHOWN = 1.96  # standard deviations of its power that an effect has to be, to be told from none


def estimates(found: ChannelFit, effect: Effect, unit: str) -> Iterator[Estimate]:
    """Of one effect's parameters, in the order in which they are declared."""
    seen = _of_lines(found, unit) if effect.lines is not None else _of_spectrum(found, effect, unit)
    hidden = hidden_in(found.channel.oddities)
    if hidden is None or not hidden.hides(effect.name):
        yield from seen
        return
    why = f"the noise is below the converter's step of {hidden.step:.4g} {unit}"
    for each in seen:
        yield replace(each, std=None, identified=False, why=why)


def _of_spectrum(found: ChannelFit, effect: Effect, unit: str) -> Iterator[Estimate]:
    strength, values, axis = effect.parameters[0], found.values[effect.name], found.channel.axis
    power, deviations = values[strength.name] ** 2, _deviations(found)
    of_power = deviations[effect.name, strength.name]
    identified = power > SHOWN * of_power
    below = float(np.sqrt(power + BOUND * of_power))
    for p in effect.parameters:
        own = p.unit.replace("{out}", unit)
        if not identified:
            why = f"this record does not tell it from none; {strength.name} is below {below:.2g} {own}"
            std = below / BOUND if p is strength else None
            yield Estimate(p.name, axis, values[p.name], std, own, False, why if p is strength else "there may be none")
        elif p is strength:
            yield Estimate(p.name, axis, values[p.name], of_power / (2 * values[p.name]), own)
        else:
            yield Estimate(p.name, axis, values[p.name], deviations[effect.name, p.name], own)


def _deviations(found: ChannelFit) -> dict[tuple[str, str], float]:
    """Standard deviation of each strength's square and of each shape, by (effect, parameter)."""
    columns: dict[tuple[str, str], Array] = {}
    for effect in found.effects:
        strength, values = effect.parameters[0].name, found.values[effect.name]
        columns[effect.name, strength] = spectrum_of(effect, found.parts, {**values, strength: 1.0})
        for p in effect.parameters[1:]:
            step = STEP * values[p.name]
            ahead, behind = ({**values, p.name: values[p.name] + side * step} for side in (1, -1))
            columns[effect.name, p.name] = (found.part_of(effect, ahead) - found.part_of(effect, behind)) / (2 * step)
    J = information(np.column_stack(list(columns.values())), found.expected, found.freedom)
    scale = np.sqrt(np.maximum(np.diag(J), np.finfo(float).tiny))
    variance = np.diag(np.linalg.pinv(J / np.outer(scale, scale))) / scale**2
    wider = max(1.0, found.excess)
    return dict(zip(columns, (wider * np.sqrt(variance)).tolist(), strict=True))


def _of_lines(found: ChannelFit, unit: str) -> Iterator[Estimate]:
    axis = found.channel.axis
    for k, line in enumerate(found.lines, 1):
        yield Estimate(f"amplitude_{k}", axis, float(line.amplitude), float(line.std), unit)
        yield Estimate(f"frequency_{k}", axis, float(line.frequency_hz), float(line.std_hz), "Hz")
    if not found.lines:
        why = f"no line stands out; one of less than {found.line_bound:.2g} {unit} would not"
        yield Estimate("amplitude_1", axis, 0.0, float(found.line_bound / SHOWN), unit, False, why)
