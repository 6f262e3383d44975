"""White noise behind a low-pass that nobody stated: a single pole on white noise is a Gauss-Markov process.

No still record tells the two apart. Where all that is fast comes from the one process, or its corner is where outputs
are filtered, the low-pass is named beside it.
"""

from __future__ import annotations

import numpy as np

from calibrations.noise_analysis.processes import GAUSS_MARKOV
from calibrations.still.channel_fit import ChannelFit
from calibrations.still.search import Search

OUTPUT_FILTER = "output-filter"
WHITE = "white-noise"
SLOWEST_HZ = 0.1  # corner of an output filter: one below it would leave of no motion anything to be measured
SHARE = 1e-3  # of the density well below the corner: less white noise than this is none


def corner_hz(found: Search, name: str) -> float | None:
    """The corner that a low-pass would have, were it what makes the process `name`; None where that is no question."""
    if name != GAUSS_MARKOV:
        return None
    jumping = {telegraph.axis for telegraph in found.telegraphs}  # no filter makes two levels
    free = (each for each in found.mixture.channels if not np.isfinite(each.channel.corner_hz))
    corners = [_corner(each) for each in free if each.channel.axis not in jumping]
    return next((corner for corner in corners if corner is not None), None)


def filter_text(name: str, corner: float) -> str:
    """Both explanations, and what tells them apart beside an experiment of the rig."""
    return (
        f"{name} cannot be told from white noise behind a first-order low-pass of {corner:.3g} Hz ({OUTPUT_FILTER}): "
        f"if the output has one, write `# filter_corner_hz: {corner:.3g}` above the table; a record with another "
        "capacitor tells, as the corner of a filter moves with it"
    )


def _corner(found: ChannelFit) -> float | None:
    sigma, time_s = found.values[GAUSS_MARKOV].values()
    if sigma == 0:
        return None
    white = sum(value**2 for value in found.values.get(WHITE, {}).values())
    corner = 1 / (2 * np.pi * time_s)
    alone = white < SHARE * 2 * sigma**2 * time_s
    return float(corner) if alone or corner > SLOWEST_HZ else None
