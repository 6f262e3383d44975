"""The record that tells two noise processes apart: how much longer it has to be.

A record of any length is foreseen as its bands with what the one explanation expects in them; the other is fitted to
these as well as it can be, and the deviance that it leaves is twice the information between the two. Both ways are
asked, and the worse one counts.

Source  Kullback and Leibler, Ann. Math. Statist. 22 (1951).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibrations.design.expected import CERTAIN, Expected, told_apart
from calibrations.experiment import Experiment
from calibrations.noise_analysis.bands import Bands, slow_bands
from calibrations.still.channel_fit import ChannelFit
from calibrations.still.fit import with_effects
from calibrations.still.record import Channel
from calibrations.still.search import Search

LONGER = (2, 4, 8, 16, 32, 64)  # times the record at hand
MEANS = 1 << 14  # of a record that is foreseen
NIGHTS_S = 7 * 86400.0  # beyond which nobody waits
PROCEDURE = "noise-floor"
WHY = "a longer record holds more periods of what is slow, where the two differ"


def separating(found: Search) -> Experiment | None:
    """The shortest record that is certain to tell, or else the longest that one would wait for."""
    name, rivals = next(((name, rivals) for name, rivals in found.rivals.items() if rivals), ("", ()))
    if not rivals:
        return None
    pairs = tuple((name, rival) for rival in rivals)
    lengths = [k * found.still.length_s for k in LONGER if k * found.still.length_s <= NIGHTS_S]
    lengths = lengths or [2 * found.still.length_s]
    foreseen = [(length_s, _information(found, name, rivals, length_s)) for length_s in lengths]
    chosen = next((each for each in foreseen if told_apart(each[1]) >= CERTAIN), foreseen[-1])
    duration_s = float(10 * np.ceil(chosen[0] / 10))
    return Experiment(PROCEDURE, {"duration_s": duration_s}, pairs, WHY, expected=Expected(chosen[1], chosen[1]))


def _information(found: Search, name: str, rivals: tuple[str, ...], length_s: float) -> float:
    """Lambda of the pair that is hardest to tell apart, the harder way."""
    effects = {effect.name: effect for effect in found.mixtures.others}
    rest = [effect for effect in found.mixture.effects if effect.name != name]
    each = []
    for rival in rivals:
        sides = (found.mixture, effects[name]), (found.mixtures.of([*rest, effects[rival]]), effects[rival])
        each += [
            sum(_lost(*pair, length_s) for pair in zip(right.channels, wrong.channels, strict=True))
            for (right, own), (wrong, other) in (sides, sides[::-1])
            if own.name not in other.contains  # what contains it can always take its form, and is then the less plain
        ]
    return min(each)


def _lost(right: ChannelFit, wrong: ChannelFit, length_s: float) -> float:
    """Deviance of the wrong effects on what the right ones expect of a record of this length."""
    there = foreseen(right.channel, length_s)
    truth = replace(right, channel=there, parts=(_slow(there),), lines=())
    bands = replace(truth.parts[0], density=truth.expected)
    return with_effects(replace(truth, parts=(bands,)), wrong.effects).deviance


def foreseen(channel: Channel, length_s: float) -> Channel:
    """A record of another length of the same channel, with means of a size that keeps them few."""
    n = int(length_s * channel.rate_hz)
    size = max(channel.size, -(-n // MEANS))
    return replace(channel, n=n, size=size, means=np.zeros(n // size))


def _slow(channel: Channel) -> Bands:
    return slow_bands(channel.means, channel.sampling, channel.corner_hz)
