"""How well a noise model does on the half of a record that it was not fitted to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibrations.effect import Effect
from calibrations.model import Model
from calibrations.still.channel_fit import ChannelFit
from calibrations.still.fit import fit_channel, noise_terms, seen
from calibrations.still.record import Channel, Still


def held_out_excess(model: Model, still: Still) -> float:
    """Pooled excess: fitted to each half of the record in turn, and judged on the other."""
    effects = tuple(term.effect for term in noise_terms(model))
    each = [_excess(pair, effects) for channel in still.channels for pair in _both_ways(channel)]
    return float(np.sqrt(np.mean(np.square(each))))


def _both_ways(channel: Channel) -> tuple[tuple[Channel, Channel], tuple[Channel, Channel]]:
    first, second = channel.halves()
    return (first, second), (second, first)


def _excess(halves: tuple[Channel, Channel], effects: Sequence[Effect]) -> float:
    """On the second half, of what was fitted to the first; lines have the phase there that fits."""
    known, other = halves
    found = fit_channel(known, effects)
    there = seen(other, found.lines)
    return ChannelFit(other, there.parts, found.lines, found.effects, found.values).excess
