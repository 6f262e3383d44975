"""A log of a gyroscope and an accelerometer that a person turned from rest to rest, as a table of turns.

A rest is an interval in which both sensors are still. Each turn has the part of the rest before it and of the rest
after it that is next to it.

Source  Tedaldi, Pretto and Menegatti, ICRA 2014: rests and turns in one log.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calibrations.criteria import FEWEST_TURNS_OF_A_GYROSCOPE
from calibrations.errors import DataError, MissingConstant
from calibrations.importing.plausible import log_rate_hz
from calibrations.importing.raw_logs import still_intervals
from calibrations.means.noise import robust_std
from calibrations.table import AXES, Array, Constant

RATES, FORCES = tuple(f"g{axis}" for axis in AXES), tuple(f"a{axis}" for axis in AXES)
LONGEST_REST_S = 5.0  # next to a turn: the bias of the gyroscope drifts over a longer rest


def cut_turns(columns: Mapping[str, Array], constants: Mapping[str, Constant], source: str) -> dict[str, Array]:
    """The samples of each turn and of its rests, with the columns `turn` and `resting`; a rest between two turns twice.

    Raises MissingConstant without times and sample rate, DataError for fewer rests than a gyroscope needs.
    """
    stated_hz = constants.get("sample_rate_hz", 0.0)
    rate_hz = log_rate_hz(columns.get("t_s"), stated_hz if isinstance(stated_hz, float) else 0.0, source)
    if rate_hz <= 0:
        raise MissingConstant(
            f"{source}: a log of turns needs the column t_s, or the constant sample_rate_hz", "sample_rate_hz"
        )
    rests = still_intervals(np.column_stack([_in_noise(columns[name]) for name in (*RATES, *FORCES)]), rate_hz)
    if len(rests) <= FEWEST_TURNS_OF_A_GYROSCOPE:
        raise DataError(
            f"{source}: found {len(rests)} rests; a gyroscope needs {FEWEST_TURNS_OF_A_GYROSCOPE + 1} or more: keep "
            "the sensor still for 1 s or more before and after each turn"
        )
    longest = round(LONGEST_REST_S * rate_hz)
    rows, turns, resting = list[NDArray[np.intp]](), list[Array](), list[Array]()
    for number, ((begin, rest_ends), (rest_begins, end)) in enumerate(pairwise(rests), start=1):
        first, last = max(begin, rest_ends - longest), min(end, rest_begins + longest)
        own_rows = np.arange(first, last)
        rows.append(own_rows)
        turns.append(np.full(len(own_rows), float(number)))
        resting.append(((own_rows < rest_ends) | (own_rows >= rest_begins)).astype(float))
    chosen = np.concatenate(rows)
    marks = {"turn": np.concatenate(turns), "resting": np.concatenate(resting)}
    times = {} if "t_s" in columns else {"t_s": chosen / rate_hz}
    return {**{name: values[chosen] for name, values in columns.items()}, **times, **marks}


def _in_noise(values: Array) -> Array:
    """Samples over their noise, so that sensors of different units count alike."""
    noise = float(robust_std(np.diff(values)))
    return values / noise if noise > 0 else np.zeros_like(values)
