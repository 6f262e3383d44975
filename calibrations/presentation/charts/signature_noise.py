"""A noise effect's signature: its part of the Allan deviation and of the spectrum, on top of white noise."""

from __future__ import annotations

import numpy as np

from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue
from calibrations.noise.allan import deviation
from calibrations.noise.channel_spectrum import Line as Sinusoid
from calibrations.noise.likelihood import ChannelFit, Values, effect_lines
from calibrations.noise.processes import Sampling
from calibrations.noise.record import Channel
from calibrations.noise.spectrum import Welch, slow_bands
from calibrations.presentation.chart import BLUE, QUIET, VERMILION, Axis, Chart, Dash, Line, Panel, Rule
from calibrations.presentation.charts.noise import root
from calibrations.presentation.charts.signature import SMALL

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


def noise_signature_chart(effect: Effect) -> Chart:
    """Left the Allan deviation, right the spectrum; broken without the effect."""
    without, beside = _beside(None), _beside(effect)
    tau_s = np.geomspace(1, SAMPLES / 8, 70).round() / RATE_HZ
    looks: tuple[tuple[ChannelFit, Dash, str], ...] = ((without, "dash", QUIET), (beside, "solid", BLUE))
    left = tuple(Line(tau_s, deviation(fit, tau_s), colour=colour, width=1.6, dash=dash) for fit, dash, colour in looks)
    right = tuple(
        Line(fit.frequency_hz[::SPARE], root(fit.expected)[::SPARE], colour=colour, width=1.6, dash=dash)
        for fit, dash, colour in looks
    )
    lines = tuple(Rule(line.frequency_hz, "x", VERMILION, 1.6) for line in beside.lines)
    panels = (_named(left, "averaging time (s)", "Allan deviation (V)"),
              _named((*right, *lines), "frequency (Hz)", "density (V/√Hz)"))  # fmt: skip
    return Chart((panels,), 1.95, SMALL)


def _named(series: tuple[Line | Rule, ...], x: str, y: str) -> Panel:
    values = np.concatenate([line.y for line in series if isinstance(line, Line)])
    return Panel(series, Axis(x, log=True), Axis(y, log=True, low=values.min() / 1.5, high=1.5 * values.max()))


def _beside(effect: Effect | None) -> ChannelFit:
    """White noise, with an effect or without, as a fit to a record that nobody measured."""
    nothing = Channel("x", "V", RATE_HZ, np.inf, SAMPLES, np.zeros(SAMPLES), 1, Welch(RATE_HZ).segments())
    white = catalogue()["white-noise"]
    effects, values = [white], {white.name: dict(WHITE)}
    lines: tuple[Sinusoid, ...] = ()
    if effect is not None:
        own = shown_noise(effect)
        effects += [effect] if "spectrum" in effect.places and effect is not white else []
        values[effect.name] = own
        lines = effect_lines(effect, own)
    parts = (slow_bands(nothing.means, Sampling(RATE_HZ)),)
    return ChannelFit(nothing, parts, lines, tuple(effects), values)
