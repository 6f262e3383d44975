"""The experiment that tells what a still record does not.

Two noise processes take a longer record. A record of any length is foreseen as its bands with what the one explanation
expects in them; the other is fitted to these as well as it can be, and the deviance that it leaves is twice the
information between the two. Both ways are asked, and the worse one counts. What no noise is takes what changes its
cause, or the same record again.

Source  Kullback and Leibler, Ann. Math. Statist. 22 (1951).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibrations.design.expected import CERTAIN, Expected, told_apart
from calibrations.experiment import TWO_HZ, Experiment, by_physics
from calibrations.noise_analysis.bands import Bands, slow_bands
from calibrations.still.channel_fit import ChannelFit
from calibrations.still.fit import with_effects
from calibrations.still.patterns import DRIFT, FOLLOWS, SETTLING, STEP, Pattern
from calibrations.still.record import Channel
from calibrations.still.search import Search

LONGER = (2, 4, 8, 16, 32, 64)  # times the record at hand
MEANS = 1 << 14  # of a record that is foreseen
NIGHTS_S = 7 * 86400.0  # beyond which nobody waits
PROCEDURE = "noise-floor"
WHY = "a longer record holds more periods of what is slow, where the two differ"
REPEATED = (
    "what a second record of the same length shows as well belongs to the sensor or the rig, the rest was an event"
)
SHAKEN = "a low-pass weakens an oscillation near its corner; noise of the sensor's own does not"
CYCLED = "what follows the temperature goes up and down with the oven, noise does not"
CAUSES = {  # what a pattern is in a model of poses, by its kind and the column that it follows
    (FOLLOWS, "temperature_c"): "temperature-bias",
    (DRIFT, ""): "bias-drift",
    (SETTLING, ""): "warm-up-bias",
}
TAKEN_FOR = "rate-random-walk"  # what each of them looks like to a spectrum


def again(length_s: float) -> Experiment:
    """The same record once more."""
    return Experiment(PROCEDURE, {"duration_s": _tens(length_s)}, (), REPEATED)


def of_pattern(pattern: Pattern, length_s: float) -> Experiment | None:
    """What tells the cause of a pattern from its rivals, or from noise; None where the rig cannot change the cause."""
    if pattern.kind == STEP:
        return again(length_s)
    cause, *others = (CAUSES.get((each.kind, each.cause)) for each in (pattern, *pattern.rivals))
    if cause is None:
        return None
    rivals = [name for name in others if name is not None] or [TAKEN_FOR]
    procedure, settings, why = by_physics({cause, *rivals} - {TAKEN_FOR})
    why = CYCLED if pattern.kind == FOLLOWS and rivals == [TAKEN_FOR] else why
    return Experiment(procedure, settings, tuple((cause, rival) for rival in rivals), why)


def behind_filter(name: str, corner_hz: float) -> Experiment | None:
    """What tells a process from white noise behind a low-pass; None where the corner is beyond what the rig shakes."""
    if not TWO_HZ[1] / 2 <= corner_hz <= 10 * TWO_HZ[0]:
        return None
    return Experiment("motion", {"frequency_hz": TWO_HZ}, ((name, "output-filter"),), SHAKEN)


def _tens(seconds: float) -> float:
    return float(10 * np.ceil(seconds / 10))


def separating(found: Search, named: tuple[str, ...]) -> Experiment | None:
    """The shortest record that is certain to tell the first of them that is in doubt from its rivals, or else the
    longest that one would wait for."""
    name, rivals = next(((name, found.rivals[name]) for name in named if found.rivals.get(name)), ("", ()))
    if not rivals:
        return None
    pairs = tuple((name, rival) for rival in rivals)
    lengths = [k * found.still.length_s for k in LONGER if k * found.still.length_s <= NIGHTS_S]
    lengths = lengths or [2 * found.still.length_s]
    foreseen = [(length_s, _information(found, name, rivals, length_s)) for length_s in lengths]
    chosen = next((each for each in foreseen if told_apart(each[1]) >= CERTAIN), foreseen[-1])
    return Experiment(PROCEDURE, {"duration_s": _tens(chosen[0])}, pairs, WHY, expected=Expected(chosen[1], chosen[1]))


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
