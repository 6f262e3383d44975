"""One noise floor for all models of a search, where nothing but what a model leaves tells the noise.

Each would else be at a floor of its own, whatever it leaves, and no two could be compared.
"""

from __future__ import annotations

from dataclasses import replace

from calibrations.fit import Fit
from calibrations.table import Array


def leaves_noise(found: Fit) -> bool:
    """Whether what a model leaves is taken for its noise: neither samples nor smooth columns tell it."""
    return not found.noise.known and not found.problem.smooth.size


def counted(found: Fit, floor: Array) -> Fit:
    """The fit with its errors counted in a floor (channels,) of another model, where its own is what it leaves."""
    return replace(found, noise=replace(found.noise, reference=floor)) if leaves_noise(found) else found
