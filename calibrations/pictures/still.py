"""Pictures of a noise model beside a still record: how its noise averages, and its spectrum, before and after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calibrations.noise_analysis.freedom import COVERAGE
from calibrations.pictures.album import Picture
from calibrations.pictures.noise import COLOURS, mark_powers, root, whole_steps
from calibrations.pictures.style import BAND, INK, QUIET, VERMILION, panels, styled
from calibrations.pictures.waterfall import Level
from calibrations.still.allan import deviation, parts
from calibrations.still.channel_fit import ChannelFit
from calibrations.still.discover import Added, Discovery
from calibrations.still.documents import mismatch
from calibrations.still.fit import NoiseFit
from calibrations.still.held_out import held_out_excess

ROOM = 4.0  # above and below a spectrum
HEIGHT = 3.6
LESS = "less what no noise is"
OTHER = "#7b5ea7"  # of effects that are not in the catalogue


def levels(start: NoiseFit, steps: Sequence[Added]) -> list[Level]:
    """The falling error of a noise model: the mismatch of its spectrum, and beside it that of its Allan deviation."""
    first = Level(start.model.name, start.pooled_excess, held_out_excess(start.model, start.still), _off(start))
    return [first, *(Level(f"+ {s.name}", s.after.pooled_excess, s.held_out_after, _off(s.after)) for s in steps)]


def _off(found: NoiseFit) -> str:
    return " and ".join(f"{100 * value:.2g} %" for value in mismatch(found).values())


def still_album(found: Discovery, given: NoiseFit) -> list[Picture]:
    """Both pictures, with words for a page. `given` is the model as it was given."""
    name = found.end.model.name
    averaging = (
        "How much neighbouring means differ, over the time that each is taken over. Dots are measured, bars are "
        f"intervals of 95 %. The broken grey line is the model {given.model.name}, the full line {name}; thin lines "
        "are its parts."
    )
    if _cleaned(found.end, given):
        averaging += " Rings are the record as it is; from the dots, what no noise is was taken off."
    spectrum = (
        "Power over frequency, one-sided, less the lines that were found. Dots are averages over narrow bands; the "
        f"grey band is where 95 % of them should be by the model {name}, the broken grey line is the model "
        f"{given.model.name}."
    )
    return [
        Picture("allan", "Allan deviation beside the model", averaging, allan(found.end, given)),
        Picture("spectrum", "Spectrum beside the model", spectrum, density(found.end, given)),
    ]


@styled
def allan(end: NoiseFit, given: NoiseFit) -> Figure:
    """Measured and expected deviations, a panel for each axis."""
    figure, axes = panels(1, len(end.channels), HEIGHT, sharex=True, sharey=True)
    for ax, after, before in zip(axes[0], end.channels, given.channels, strict=True):
        curve = end.still.allan[after.channel.axis]
        bars = np.array([curve.deviation - curve.low, curve.high - curve.deviation])
        if _cleaned(end, given):
            raw = given.still.allan[after.channel.axis]
            ax.plot(raw.tau_s, raw.deviation, "o", color=QUIET, mfc="none", label="measured")
        label = f"measured, {LESS}" if _cleaned(end, given) else "measured"
        ax.errorbar(curve.tau_s, curve.deviation, bars, fmt="o", color=INK, elinewidth=0.8, label=label, zorder=3)
        tau_s = whole_steps(1 / after.channel.rate_hz, curve.tau_s[-1], after.channel.rate_hz)
        if not _alike(end, given):
            ax.plot(tau_s, deviation(before, tau_s), "--", color=QUIET, lw=1.4, label=given.model.name)
        ax.plot(tau_s, deviation(after, tau_s), color=INK, lw=1.4, label=_name(end, given))
        if len(after.effects) + len(after.lines) > 1:
            for name, variance in parts(after, tau_s).items():
                ax.plot(tau_s, np.sqrt(variance), color=COLOURS.get(name, OTHER), lw=0.8, label=name)
        low, high = curve.low.min(), curve.high[curve.edf > 1].max()
        ax.set(xscale="log", yscale="log", ylim=(low / 2, high * 2), xlabel="averaging time (s)")
        ax.legend(loc="upper center")
        _named(ax, end, after)
    axes[0, 0].set_ylabel(f"Allan deviation ({end.still.unit})")
    return figure


@styled
def density(end: NoiseFit, given: NoiseFit) -> Figure:
    """Measured and expected one-sided amplitude densities, a panel for each axis."""
    figure, axes = panels(1, len(end.channels), HEIGHT, sharex=True, sharey=True)
    for ax, after, before in zip(axes[0], end.channels, given.channels, strict=True):
        order = np.argsort(after.frequency_hz)
        f, expected = after.frequency_hz[order], after.expected[order]
        low, high = after.interval(COVERAGE)
        ax.fill_between(f, root(low[order]), root(high[order]), color=BAND, lw=0)
        ax.plot(f, root(after.seen[order]), "o", color=INK, ms=2.0, label="measured")
        if not _alike(end, given):
            there = np.argsort(before.frequency_hz)
            level = root(before.expected[there])
            ax.plot(before.frequency_hz[there], level, "--", color=QUIET, lw=1.4, label=given.model.name)
        ax.plot(f, root(expected), color=INK, lw=1.2, label=_name(end, given))
        for effect in after.effects if len(after.effects) > 1 else ():
            shown = root(after.part_of(effect)[order])
            ax.plot(f, shown, color=COLOURS.get(effect.name, OTHER), lw=0.8, label=effect.name)
        for line in after.lines:
            ax.axvline(line.frequency_hz, color=VERMILION, lw=0.7, ls=":")
        ax.set(xscale="log", yscale="log", xlabel="frequency (Hz)")
        ax.legend()
        _named(ax, end, after)
    levels = np.concatenate([root(each.expected) for each in end.channels])
    axes[0, 0].set_ylim(levels.min() / ROOM, ROOM * levels.max())
    axes[0, 0].set_ylabel(f"density ({end.still.unit}/√Hz)")
    return figure


def _alike(end: NoiseFit, given: NoiseFit) -> bool:
    """Whether both are one curve: the same effects with the same values, beside the same record."""
    same = [after.values == before.values for after, before in zip(end.channels, given.channels, strict=True)]
    return all(same) and end.model.effects == given.model.effects


def _cleaned(end: NoiseFit, given: NoiseFit) -> bool:
    """Whether something was taken off the record."""
    return end.still is not given.still


def _name(end: NoiseFit, given: NoiseFit) -> str:
    """Of the final model: the one that was given may have its name and other values, or another record."""
    if end.model.name != given.model.name or _alike(end, given):
        return end.model.name
    return f"{end.model.name}, {LESS}" if _cleaned(end, given) else f"{end.model.name}, fitted"


def _named(ax: Axes, end: NoiseFit, channel: ChannelFit) -> None:
    mark_powers(ax)
    if len(end.channels) > 1:
        ax.set_title(f"axis {channel.channel.axis}")
