"""The analysis behind calibration by hand, for a session: the test of rest, and the choice of attitudes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from calibrations.table import Table
from procedures.session import Dwell, HandCourse, NoiseAtRest, RecordedPose, Stillness
from rig.record.turns import is_turn, turn_columns
from rig.record.values import KeptPose


class HandAnalysis:
    """As `procedures.session.HandAnalysis`. Its functions are slow to import, and only procedures by hand need them."""

    def learn(self, windows: Sequence[NDArray[np.float64]], rate_hz: float) -> NoiseAtRest | None:
        """The noise from windows at rest."""
        from calibrations.analyses.stillness import learn_noise

        return learn_noise(windows, rate_hz)

    def judge(self, windows: Sequence[NDArray[np.float64]], noise: NoiseAtRest) -> Stillness:
        """The test of the last of successive windows."""
        from calibrations.analyses.stillness import judge_window

        return judge_window(windows, cast(Any, noise))

    def course(self, dwells: Sequence[Dwell], noise: NoiseAtRest, skipped: Sequence[str] = ()) -> HandCourse:
        """The positions so far; orientations with the words `skipped` are not requested again.

        The path of a pose has the requested orientation, in words.
        """
        from calibrations.analyses.hand_positions import OUTPUTS, HandPosition
        from calibrations.analyses.hand_positions import HandCourse as Course
        from calibrations.design.orientations import ORIENTATIONS, name_orientation

        def position(dwell: Dwell) -> HandPosition:
            orientation = name_orientation(dwell.pose.path)
            stated = ORIENTATIONS[0] if orientation is None else orientation
            return HandPosition(*_statistics(dwell, OUTPUTS), dwell.n, stated, dwell.t_s)

        unwanted = np.array([up for words in skipped if (up := name_orientation(words)) is not None]).reshape(-1, 3)
        return Course(tuple(map(position, dwells)), cast(Any, noise), unwanted)

    def field_course(self, dwells: Sequence[Dwell], noise: NoiseAtRest, skipped: Sequence[str] = ()) -> HandCourse:
        """The positions of a magnetometer so far; attitudes with the words `skipped` are not requested again."""
        from calibrations.analyses.hand_fields import OUTPUTS, FieldCourse
        from calibrations.analyses.hand_positions import HandPosition
        from calibrations.design.attitudes import ATTITUDES, name_attitude

        attitudes = tuple(name_attitude(dwell.pose.path) or ATTITUDES[0] for dwell in dwells)
        positions = tuple(
            HandPosition(*_statistics(dwell, OUTPUTS), dwell.n, attitude.up, dwell.t_s)
            for dwell, attitude in zip(dwells, attitudes, strict=True)
        )
        unwanted = tuple(attitude for words in skipped if (attitude := name_attitude(words)) is not None)
        return FieldCourse(positions, cast(Any, noise), attitudes, unwanted)

    def clipped(self, turn: NDArray[np.float64], rest: NDArray[np.float64]) -> int | None:
        """The output that a turn clips."""
        from calibrations.geometry.clipped_turns import find_clipped_output

        return find_clipped_output(turn, rest)

    def turn_course(self, recorded: Sequence[RecordedPose], noise: NoiseAtRest, rest_s: float) -> HandCourse:
        """The rests and turns so far; the path of a rest has the requested orientation, in words."""
        from calibrations.analyses.hand_turns import TurnCourse

        rests = [cast(KeptPose, each).dwell for each in recorded if not is_turn(each.pose)]
        columns = turn_columns(recorded, rest_s)
        table = Table.from_columns("turns", columns, {}, "turns by hand") if columns else None
        course = cast(Any, self.course(rests, noise))
        return TurnCourse(course.positions, course.noise, table=table)


def _statistics(dwell: Dwell, outputs: Sequence[str]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and standard deviation of the outputs, each (3,)."""
    mean, std = (np.array([values[name] for name in outputs]) for values in (dwell.means, dwell.stds))
    return mean, std
