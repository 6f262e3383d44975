"""A noise effect's signature: what it adds to the Allan deviation and to the spectrum of white noise."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calibrations.effect import Effect, catalogue
from calibrations.noise_analysis.bands import slow_bands
from calibrations.noise_analysis.lines import Line
from calibrations.noise_analysis.processes import Sampling
from calibrations.noise_analysis.welch import Welch
from calibrations.pictures.noise import mark_powers, root
from calibrations.pictures.style import BLUE, QUIET, VERMILION, styled
from calibrations.still.allan import deviation
from calibrations.still.channel_fit import ChannelFit, Values
from calibrations.still.record import Channel

RATE_HZ, SAMPLES = 10.0, 1 << 15
SPARE = 3  # of so many bands one is drawn
WHITE = {"coefficient": 1.0}
SHOWN: dict[str, Values] = {  # beside white noise of 1 V/sqrt(Hz)
    "white-noise": {"coefficient": 2.0},
    "flicker-noise": {"coefficient": 0.5},
    "rate-random-walk": {"coefficient": 0.05},
    "quantisation-noise": {"coefficient": 1.0},
    "gauss-markov-noise": {"sigma": 0.5, "time_constant": 20.0},
    "sinusoidal-noise": {"amplitude_1": 0.5, "frequency_1": 0.05},
}


def shown_noise(effect: Effect) -> Values:
    """Parameters that make the effect stand out of white noise of 1 unit/sqrt(Hz)."""
    return SHOWN.get(effect.name) or {p.name: 0.5 if p is effect.parameters[0] else 20.0 for p in effect.parameters}


@styled
def picture(effect: Effect) -> Figure:
    """Left the Allan deviation, right the spectrum; broken without the effect."""
    figure = Figure(figsize=(7.2, 2.45))
    left, right = figure.subplots(1, 2)
    without, beside = _beside(None), _beside(effect)
    tau_s = np.geomspace(1, SAMPLES / 8, 70).round() / RATE_HZ
    for ax, fit, style, colour in ((left, without, "--", QUIET), (left, beside, "-", BLUE)):
        ax.plot(tau_s, deviation(fit, tau_s), style, color=colour, lw=1.3)
    for fit, style, colour in ((without, "--", QUIET), (beside, "-", BLUE)):
        right.plot(fit.frequency_hz[::SPARE], root(fit.expected)[::SPARE], style, color=colour, lw=1.3)
    for line in beside.lines:
        right.axvline(line.frequency_hz, color=VERMILION, lw=1.3)
    _named(left, "averaging time (s)", "Allan deviation (V)")
    _named(right, "frequency (Hz)", "density (V/√Hz)")
    return figure


def _named(ax: Axes, x: str, y: str) -> None:
    ax.set(xscale="log", yscale="log", xlabel=x, ylabel=y)
    low, high = ax.get_ylim()
    ax.set_ylim(low / 1.5, high * 1.5)
    mark_powers(ax)


def _beside(effect: Effect | None) -> ChannelFit:
    """White noise, with an effect or without, as a fit to a record that nobody measured."""
    nothing = Channel("x", "V", RATE_HZ, np.inf, SAMPLES, np.zeros(SAMPLES), 1, Welch(RATE_HZ).segments())
    white = catalogue()["white-noise"]
    effects, values = [white], {white.name: dict(WHITE)}
    lines: tuple[Line, ...] = ()
    if effect is not None:
        own = shown_noise(effect)
        effects += [effect] if effect.spectrum is not None and effect is not white else []
        values[effect.name] = own
        lines = tuple(Line(f_hz, a, 0.0) for f_hz, a in effect.lines(own)) if effect.lines is not None else ()
    parts = (slow_bands(nothing.means, Sampling(RATE_HZ)),)
    return ChannelFit(nothing, parts, lines, tuple(effects), values)
