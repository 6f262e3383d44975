"""The doubts after a search on a still record: disturbances, rival processes, and the experiment that decides.

A disturbance is everything in a still record that is not a noise process:

pattern          a step, a drift, a settling, an output that follows a logged column; removed before the fit
odd samples      wild samples, a stretch of equal samples, noise below one converter step; reported
two levels       random telegraph noise of two or more, which has the spectrum of a Gauss-Markov process; reported
misfit           a line, a noise level that changes with time, a stretch of the spectrum that no process explains

Two noise processes are separated by a longer record. Its bands are computed as one explanation expects them, and the
other explanation is fitted to them; the deviance of that fit is twice the information between the two. Both directions
are computed, and the smaller information counts. A disturbance is separated from noise by a run that changes its cause,
or by a second record.

White noise behind a single pole is a Gauss-Markov process, so a still record cannot separate the two. If all fast noise
is from that process, or its corner is a usual corner of an output filter, the low-pass is named as an alternative.

Source  Kullback and Leibler, Ann. Math. Statist. 22 (1951).
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from calibrations.criteria import CERTAIN_PROBABILITY, LEAST_WHITE, LONGEST_RECORD_S, SIGNIFICANT, SLOWEST_FILTER_HZ
from calibrations.design.expected import ExpectedResult, pairs_separated
from calibrations.design.experiment import TWO_HZ, Experiment, experiment_by_physics
from calibrations.noise.comparison import noise_levels, stretches
from calibrations.noise.fit import fit_effects
from calibrations.noise.likelihood import ChannelFit
from calibrations.noise.lines import SpectralLine, strongest_line
from calibrations.noise.patterns import DRIFT, FOLLOWS, SETTLING, STEP, Pattern
from calibrations.noise.record import Channel
from calibrations.noise.samples import hidden_in
from calibrations.noise.search import Search
from calibrations.noise.telegraph import Telegraph
from calibrations.spectrum import GAUSS_MARKOV, Bands, slow_bands
from calibrations.table import Array

LINE, LEVEL, STRETCH = "line", "level", "spectrum"
MISFITS = (LINE, LEVEL, STRETCH)
ALL_OF_JUMP = 0.98  # of the variance of means: a random walk leaves more than a tenth beside one step
FEWEST_MEANS, FEWEST_BESIDE_JUMP = 50, 5


@dataclass(frozen=True)
class Disturbance:
    """One disturbance of one channel.

    kind       such as `step`, `follows`, `wild-samples`, `level`
    matters    whether it changes the noise coefficients by more than their uncertainty
    pattern    the part removed from the record, if any
    telegraph  the levels of random telegraph noise
    """

    kind: str
    axis: str
    text: str
    matters: bool = True
    pattern: Pattern | None = None
    telegraph: Telegraph | None = None


def disturbances(search: Search) -> tuple[Disturbance, ...]:
    """All disturbances: removed patterns, levels, odd samples; a misfit only where none of these matters."""
    patterns = list(map(as_disturbance, search.patterns))
    levels = [
        Disturbance(telegraph.kind, telegraph.axis, telegraph.text, False, telegraph=telegraph)
        for telegraph in search.telegraphs
    ]
    odd = [
        Disturbance(disturbance.kind, channel.axis, f"of {channel.axis}, {disturbance.text}", disturbance.matters)
        for channel in search.still.channels
        for disturbance in channel.oddities
    ]
    entries = (*patterns, *levels, *odd)
    if any(disturbance.matters for disturbance in entries):
        return entries
    misfit = misfit_of(search.end.channels, {telegraph.axis for telegraph in search.telegraphs})
    return entries if misfit is None else (*entries, misfit)


def as_disturbance(pattern: Pattern) -> Disturbance:
    """A pattern that was removed from the record."""
    return Disturbance(pattern.kind, pattern.axis, pattern.text, True, pattern)


def misfit_of(channels: tuple[ChannelFit, ...], jumping: Set[str] = frozenset()) -> Disturbance | None:
    """The first misfit that chance does not explain, over all channels.

    jumping  axes with random telegraph noise: a part of the record with more jumps than another has more noise
    """
    limit = SIGNIFICANT / (len(MISFITS) * len(channels))
    misfits = (
        _line(fit) or (None if fit.channel.axis in jumping else _level(fit, limit)) or _stretch(fit, limit)
        for fit in channels
    )
    return next((misfit for misfit in misfits if misfit is not None), None)


def disturbance_document(disturbance: Disturbance) -> dict[str, Any]:
    """One entry of `disturbances` in every JSON document on a still record."""
    entry = {name: getattr(disturbance, name) for name in ("kind", "axis", "text", "matters")}
    pattern, telegraph = disturbance.pattern, disturbance.telegraph
    if telegraph is not None:
        levels = [asdict(level) for level in telegraph.levels]
        return entry | {"levels": levels, "jumps": telegraph.jumps, "traps": list(telegraph.traps)}
    if pattern is None:
        return entry
    return entry | {
        "text": pattern.plain,
        "column": pattern.cause or None,
        "value": pattern.size,
        "std": pattern.std,
        "cannot_be_told_from": [rival.plain for rival in pattern.rivals],
    }


def _line(fit: ChannelFit) -> Disturbance | None:
    line = strongest_line(fit.channel, fit.lines, fit.level)
    if not isinstance(line, SpectralLine):
        return None
    axis = fit.channel.axis
    return Disturbance(LINE, axis, f"a line of {axis} at {line.frequency_hz:.6g} Hz, of amplitude {line.amplitude:.3g}")


def _level(fit: ChannelFit, limit: float) -> Disturbance | None:
    level = noise_levels(fit)
    return Disturbance(LEVEL, level.axis, level.text) if level is not None and level.chance < limit else None


def _stretch(fit: ChannelFit, limit: float) -> Disturbance | None:
    worst = stretches(fit, most=1)[0]
    return Disturbance(STRETCH, worst.axis, worst.text) if worst.chance < limit else None


LONGER = (2, 4, 8, 16, 32, 64)  # times the record at hand
MEANS = 1 << 14  # of a simulated record
PROCEDURE = "noise-floor"
LONGER_SEPARATES = "the two differ at low frequencies, of which a longer record holds more periods"
REPEAT_SHOWS = "a disturbance of the sensor or the rig is in a second record of the same length too; an event is not"
MOTION_SHOWS = "a low-pass weakens an oscillation near its corner; the noise of a sensor does not"
OVEN_SHOWS = "an output that follows the temperature rises and falls with the oven; noise does not"
CAUSES = {  # what a pattern is in a model of poses, by its kind and the column that it follows
    (FOLLOWS, "temperature_c"): "temperature-bias",
    (DRIFT, ""): "bias-drift",
    (SETTLING, ""): "warm-up-bias",
}
TAKEN_FOR = "rate-random-walk"  # the process with nearly the spectrum of each of them


def repeat_record(length_s: float) -> Experiment:
    """An experiment that repeats the same record."""
    return Experiment(PROCEDURE, {"duration_s": _round_up_to_tens(length_s)}, (), REPEAT_SHOWS)


def experiment_for_pattern(pattern: Pattern, length_s: float) -> Experiment | None:
    """The experiment that separates the cause of a pattern from its rivals, or from noise; None without one."""
    if pattern.kind == STEP:
        return repeat_record(length_s)
    cause, *causes_of_rivals = (
        CAUSES.get((candidate.kind, candidate.cause)) for candidate in (pattern, *pattern.rivals)
    )
    if cause is None:
        return None
    rivals = [name for name in causes_of_rivals if name is not None] or [TAKEN_FOR]
    procedure, settings, reason = experiment_by_physics({cause, *rivals} - {TAKEN_FOR})
    reason = OVEN_SHOWS if pattern.kind == FOLLOWS and rivals == [TAKEN_FOR] else reason
    return Experiment(procedure, settings, tuple((cause, rival) for rival in rivals), reason)


def experiment_for_filter(name: str, corner_hz: float) -> Experiment | None:
    """The motion that separates a process from white noise behind a low-pass; None for a corner out of reach."""
    if not TWO_HZ[1] / 2 <= corner_hz <= 10 * TWO_HZ[0]:
        return None
    return Experiment("motion", {"frequency_hz": TWO_HZ}, ((name, "output-filter"),), MOTION_SHOWS)


def _round_up_to_tens(seconds: float) -> float:
    return float(10 * np.ceil(seconds / 10))


def design_separating_record(search: Search, names: tuple[str, ...]) -> Experiment | None:
    """The shortest record that separates the first uncertain effect from its rivals with certainty.

    If no length is certain, the longest one.
    """
    name, rivals = next(((name, search.rivals[name]) for name in names if search.rivals.get(name)), ("", ()))
    if not rivals:
        return None
    pairs = tuple((name, rival) for rival in rivals)
    lengths = [k * search.still.length_s for k in LONGER if k * search.still.length_s <= LONGEST_RECORD_S]
    lengths = lengths or [2 * search.still.length_s]
    predictions = [(length_s, _information(search, name, rivals, length_s)) for length_s in lengths]
    choice = next(
        (option for option in predictions if pairs_separated(option[1]) >= CERTAIN_PROBABILITY), predictions[-1]
    )
    return Experiment(
        PROCEDURE,
        {"duration_s": _round_up_to_tens(choice[0])},
        pairs,
        LONGER_SEPARATES,
        expected=ExpectedResult(choice[1], choice[1]),
    )


def _information(search: Search, name: str, rivals: tuple[str, ...], length_s: float) -> float:
    """Lambda of the pair that is hardest to separate, in the direction with less information."""
    effects = {effect.name: effect for effect in search.mixtures.missing}
    remaining = [effect for effect in search.mixture.effects if effect.name != name]
    deviances = []
    for rival in rivals:
        sides = (search.mixture, effects[name]), (search.mixtures.of([*remaining, effects[rival]]), effects[rival])
        deviances += [
            sum(_deviance_of_wrong(*pair, length_s) for pair in zip(true_fit.channels, rival_fit.channels, strict=True))
            for (true_fit, true_effect), (rival_fit, rival_effect) in (sides, sides[::-1])
            if true_effect.name not in rival_effect.contains  # a process that contains it can take its form
        ]
    return min(deviances)


def _deviance_of_wrong(true_fit: ChannelFit, rival_fit: ChannelFit, length_s: float) -> float:
    """Deviance of the wrong effects on what the right ones expect of a record of this length."""
    channel = longer_channel(true_fit.channel, length_s)
    truth = replace(true_fit, channel=channel, parts=(_slow_bands(channel),), lines=(), fits={})
    bands = replace(truth.parts[0], density=truth.expected)
    return fit_effects(replace(truth, parts=(bands,), fits={}), rival_fit.effects).deviance


def longer_channel(channel: Channel, length_s: float) -> Channel:
    """A record of another length of the same channel, with means of a size that keeps them few."""
    n = int(length_s * channel.rate_hz)
    size = max(channel.size, -(-n // MEANS))
    return replace(channel, n=n, size=size, means=np.zeros(n // size))


def _slow_bands(channel: Channel) -> Bands:
    return slow_bands(channel.means, channel.sampling, channel.corner_hz)


OUTPUT_FILTER = "output-filter"
WHITE = "white-noise"


def possible_corner_hz(search: Search, name: str) -> float | None:
    """The corner of a low-pass that would explain the process `name`; None where no low-pass can."""
    if name != GAUSS_MARKOV:
        return None
    jumping = {telegraph.axis for telegraph in search.telegraphs}  # no filter makes levels
    free = (fit for fit in search.mixture.channels if not np.isfinite(fit.channel.corner_hz))
    corners = [_channel_corner_hz(fit) for fit in free if fit.channel.axis not in jumping]
    return next((corner for corner in corners if corner is not None), None)


def filter_text(name: str, corner: float) -> str:
    """Both explanations of such noise, and two ways to decide between them without the rig."""
    return (
        f"{name} cannot be separated from white noise behind a first-order low-pass of {corner:.3g} Hz "
        f"({OUTPUT_FILTER}): if the output has one, write `# filter_corner_hz: {corner:.3g}` above the table; or "
        "record with another filter capacitor: the corner of a filter changes with it"
    )


def _channel_corner_hz(fit: ChannelFit) -> float | None:
    sigma, time_s = fit.values[GAUSS_MARKOV].values()
    if sigma == 0:
        return None
    white = sum(value**2 for value in fit.values.get(WHITE, {}).values())
    corner = 1 / (2 * np.pi * time_s)
    fits_alone = white < LEAST_WHITE * 2 * sigma**2 * time_s
    return float(corner) if fits_alone or corner > SLOWEST_FILTER_HZ else None


def structure_of(search: Search) -> str | None:
    """The disturbances that matter, in words; None where there are none."""
    return "; ".join(disturbance.text for disturbance in disturbances(search) if disturbance.matters) or None


def alternatives(search: Search, names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """For each named effect, those that the record cannot separate from it; a low-pass is named by its effect."""
    filtered = {name: (OUTPUT_FILTER,) for name in names if possible_corner_hz(search, name) is not None}
    rivals_by_name = {name: (*search.rivals.get(name, ()), *filtered.get(name, ())) for name in names}
    return {name: rivals for name, rivals in rivals_by_name.items() if rivals}


def reason_of(search: Search, doubts: Mapping[str, tuple[str, ...]], structure: str | None) -> str | None:
    """Why something is in doubt, in words."""
    reasons = []
    for name, rivals in doubts.items():
        if processes := [rival for rival in rivals if rival != OUTPUT_FILTER]:
            reasons.append(f"this record cannot separate {name} from {' or '.join(processes)}")
        if (corner := possible_corner_hz(search, name)) is not None:
            reasons.append(filter_text(name, corner))
    if structure is not None and search.still.hidden:
        reasons.append(structure)
    elif structure is not None:
        reasons.append(f"no noise of the catalogue explains: {structure}")
    return "; ".join(reasons) or None


def next_of(search: Search, doubts: Mapping[str, tuple[str, ...]], structure: str | None) -> Experiment | None:
    """The experiment for the first doubt that one can settle."""
    if any(hidden_in(channel.oddities) for channel in search.still.channels):
        return None  # the text says what to do, and no run does it
    if any(rival != OUTPUT_FILTER for rivals in doubts.values() for rival in rivals):
        return design_separating_record(search, tuple(doubts))
    motions = (
        experiment_for_filter(name, corner)
        for name in doubts
        if (corner := possible_corner_hz(search, name)) is not None
    )
    if (first := next(filter(None, motions), None)) is not None:
        return first
    if search.patterns:
        return experiment_for_pattern(search.patterns[0], search.still.length_s)
    return repeat_record(search.still.length_s) if structure is not None else None


def record_doubts(channels: tuple[Channel, ...]) -> list[str]:
    """Points to check in a record with any model: odd samples that matter, and a level that jumps."""
    advice = "use a part of the record without it, or measure again (`rig noise` shows where)"
    odd = [
        f"{oddity.text} ({channel.axis}): {advice}"
        for channel in channels
        for oddity in channel.oddities
        if oddity.matters and oddity.hidden is None
    ]
    jumps = ((channel, _jump(channel.means)) for channel in channels)
    return odd + [
        f"the level of {channel.axis} changes by {jump[1]:.3g} {channel.unit} after {jump[0]:.0%} of the record, and "
        f"nowhere else: the sensor was moved, or its supply changed; {advice}"
        for channel, jump in jumps
        if jump is not None
    ]


def _jump(means: Array) -> tuple[float, float] | None:
    """(share of the record before it, height) of a step that is nearly all of the variation of the means, or None."""
    n = len(means)
    if n < FEWEST_MEANS or not np.ptp(means):
        return None
    deviations = means - means.mean()
    count = np.arange(1, n)
    sums = np.cumsum(deviations)[:-1]
    gained = sums**2 * n / (count * (n - count))  # of the sum of squares, by two levels
    k = int(np.argmax(gained))
    if gained[k] < ALL_OF_JUMP * float(deviations @ deviations) or min(k + 1, n - k - 1) < FEWEST_BESIDE_JUMP:
        return None
    return (k + 1) / n, float(-sums[k] / (n - k - 1) - sums[k] / (k + 1))


def has_disturbance(search: Search) -> bool:
    """Whether there is a disturbance with a place or a cause of its own: a pattern, or odd samples."""
    return any(disturbance.matters and disturbance.kind not in MISFITS for disturbance in disturbances(search))
