"""The analysis behind positions by hand, for a session: the test of rest, and the choice of orientations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from procedures.session import Dwell, HandCourse, NoiseAtRest, Stillness

OUTPUTS = ("ax", "ay", "az")


class HandAnalysis:
    """As `procedures.session.HandAnalysis`. Its functions are slow to import, and only positions by hand need them."""

    def learn(self, windows: Sequence[NDArray[np.float64]], rate_hz: float) -> NoiseAtRest | None:
        """The noise from windows at rest."""
        from calibrations.analyses.stillness import learn_noise

        return learn_noise(windows, rate_hz)

    def judge(self, windows: Sequence[NDArray[np.float64]], noise: NoiseAtRest) -> Stillness:
        """The test of the last of successive windows."""
        from calibrations.analyses.stillness import judge_window

        return judge_window(windows, cast(Any, noise))

    def course(self, dwells: Sequence[Dwell], noise: NoiseAtRest, skipped: Sequence[str] = ()) -> HandCourse:
        """The positions so far; orientations with the words `skipped` are not wanted.

        The path of a pose has the orientation that was wanted, in words.
        """
        from calibrations.analyses.hand_positions import HandCourse as Course
        from calibrations.analyses.hand_positions import HandPosition
        from calibrations.design.orientations import ORIENTATIONS, name_orientation

        def position(dwell: Dwell) -> HandPosition:
            mean, std = (np.array([values[name] for name in OUTPUTS]) for values in (dwell.means, dwell.stds))
            orientation = name_orientation(dwell.pose.path)
            return HandPosition(mean, std, dwell.n, ORIENTATIONS[0] if orientation is None else orientation, dwell.t_s)

        unwanted = np.array([up for words in skipped if (up := name_orientation(words)) is not None]).reshape(-1, 3)
        return Course(tuple(map(position, dwells)), cast(Any, noise), unwanted)
