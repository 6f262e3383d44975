"""A world for digital sensors: outputs that tell when they were sampled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.handheld.world import HandheldWorld

FORCE_G = {"ax": 0.1, "ay": -0.2, "az": 1.0}
RATE_DEG_S = {"gx": 3.0, "gy": -40.0, "gz": 15.0}
FIELD_UT = {"mx": 20.0, "my": -5.0, "mz": 43.0}
LEVEL = FORCE_G | RATE_DEG_S | FIELD_UT


class Ramp:
    """Outputs of LEVEL, with a ramp of 1e-3 g, deg/s and uT a second."""

    trims = HandheldWorld.trims
    samples = 0  # taken so far

    def thermometer_c(self) -> float:
        return 24.5

    def sensed(self, outputs: Sequence[str], start_s: float, interval_s: float, n: int) -> NDArray[np.float64]:
        t_s = start_s + interval_s * np.arange(n)
        self.samples += n
        return np.column_stack([LEVEL[name] + 1e-3 * t_s for name in outputs])
