"""The turns of a gyroscope in a run by hand: the samples of each turn with those of its rests.

A turn is a pose that begins with the rest before it; the next pose is the rest after it.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from calibrations.table import Array
from procedures.hand_turns import FORCES, RATES, TURN
from procedures.session import Pose, RecordedPose


def is_turn(pose: Pose) -> bool:
    """Whether a pose is a turn, also one that is not used; else it is a rest."""
    return TURN in pose.path


def turn_columns(poses: Iterable[RecordedPose], rest_s: float) -> dict[str, Array]:
    """Columns of all samples of the turns that can be used and of their rests; empty without a turn.

    A turn without the rest after it does not count: the run was interrupted, or one of both is excluded. After an
    interruption the next rest does not follow in time.
    """
    parts: list[dict[str, Array]] = []
    turn: RecordedPose | None = None
    for recorded in poses:
        if turn is not None and not is_turn(recorded.pose) and _follows(recorded, turn):
            parts.append(_samples(turn, recorded, rest_s))
        turn = recorded if recorded.pose.path.startswith(TURN) else None
    names = [name for name in parts[0] if all(name in part for part in parts)] if parts else []
    return {name: np.concatenate([part[name] for part in parts]) for name in names}


def _follows(rest: RecordedPose, turn: RecordedPose) -> bool:
    """Whether the samples of both are one record without a gap."""
    between_s = (len(turn.samples.volts) + len(rest.samples.volts)) / turn.samples.rate_hz / 2
    return abs(rest.t_s - turn.t_s - between_s) < 2 / turn.samples.rate_hz


def _samples(turn: RecordedPose, rest: RecordedPose, rest_s: float) -> dict[str, Array]:
    """The samples of a turn and of the rest after it."""
    volts = np.concatenate([turn.samples.volts, rest.samples.volts])
    rate_hz, n, moving = turn.samples.rate_hz, len(volts), len(turn.samples.volts)
    resting = np.ones(n)
    resting[round(rest_s * rate_hz) : moving] = 0.0
    first_s = turn.t_s - moving / rate_hz / 2
    columns = {"t_s": first_s + np.arange(n) / rate_hz, "turn": np.full(n, float(turn.number)), "resting": resting}
    columns |= {name: volts[:, list(turn.samples.channels).index(name)] for name in (*RATES, *FORCES)}
    if turn.temperature_c is not None and rest.temperature_c is not None:
        columns["temperature_c"] = np.full(n, (turn.temperature_c + rest.temperature_c) / 2)
    return columns
