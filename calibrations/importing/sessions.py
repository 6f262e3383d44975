"""Hand sessions in named sections: a gyroscope rests on its faces and turns about its edges; the result is a rate
table.

The column `path` names the section of each sample. A section is a turn if the gyroscope's mean there is far from that
of the quietest section. The constant `turn_deg` gives the angle of each turn about the upright edge, positive by the
right-hand rule. The mean rate is this angle over the section's time, for any unsteady hand; so a section keeps no
standard deviation.

Source  Ferraris, Grimaldi and Parvis, Sensors and Materials 7 (1995): six faces, and one turn about each edge.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np

from calibrations.criteria import FEWEST_SECTION_SAMPLES, LEAST_TURN_NOISE, LEAST_TURN_SHARE
from calibrations.errors import DataError, MissingConstant
from calibrations.importing.plausible import log_rate_hz
from calibrations.table import AXES, Array, Constant, Table

OUTPUTS = ("gx", "gy", "gz")
RATE, TURN = "rate_deg_s", "turn_deg"


def is_session(kind: str | None, columns: Mapping[str, Array], sections: Sequence[str] | None) -> bool:
    """Whether the rows are samples of rests and turns without a rate column."""
    return kind == "rates" and RATE not in columns and bool(sections) and all(name in columns for name in OUTPUTS)


def is_whole_turn_log(kind: str | None, columns: Mapping[str, Array], constants: Mapping[str, Constant]) -> bool:
    """Whether the rows are samples of a gyroscope alone with a stated angle of each turn."""
    known = (RATE, *(f"a{axis}" for axis in AXES))
    return (
        kind == "rates"
        and TURN in constants
        and all(name in columns for name in OUTPUTS)
        and not any(name in columns for name in known)
    )


def sample_rates(
    columns: Mapping[str, Array], sections: Sequence[str], constants: Mapping[str, Constant], source: str
) -> Array:
    """The mean rate of each sample's section, deg/s, shape (n,); 0 at rest. Raises DataError."""
    bounds, outputs = _bounds(sections), np.column_stack([columns[name] for name in OUTPUTS])
    quiet = min(bounds, key=lambda bound: float(outputs[bound[0] : bound[1]].std(axis=0).sum()))
    means = np.array([outputs[a:b].mean(axis=0) for a, b in bounds])
    distances = np.linalg.norm(means - means[bounds.index(quiet)], axis=1)
    a, b = quiet
    if distances.max() <= LEAST_TURN_NOISE * float(np.linalg.norm(outputs[a:b].std(axis=0))):
        raise DataError(
            f"{source}: no section is a turn: the means of gx, gy, gz are the same in all sections; "
            "turn the sensor in some of them"
        )
    rates = np.zeros(len(outputs))
    for (a, b), size in zip(bounds, distances, strict=True):
        if size > LEAST_TURN_SHARE * distances.max():
            rates[a:b] = _turn_deg(constants, source) / _length_s(columns, constants, (a, b), source)
    return rates


def is_section_log(table: Table) -> bool:
    """Whether rows of rates are samples of named sections, not means."""
    sections = table.labels.get("path")
    return (
        table.type.turning
        and bool(sections)
        and "n" not in table
        and table.n > FEWEST_SECTION_SAMPLES * len(_bounds(sections or ()))
    )


def average_sections(log: Table) -> Table:
    """The mean of each section, with its number of samples."""
    bounds = _bounds(log.labels["path"])
    columns = {name: np.array([values[a:b].mean() for a, b in bounds]) for name, values in log.columns.items()}
    columns["n"] = np.array([float(b - a) for a, b in bounds])
    labels = {name: tuple(words[a] for a, _ in bounds) for name, words in log.labels.items()}
    constants = {name: value for name, value in log.constants.items() if name != TURN}
    return Table.from_columns("rates", columns, constants, log.source, labels)


def _bounds(sections: Sequence[str]) -> list[tuple[int, int]]:
    """First row and end row of each section."""
    ends = np.cumsum([len(list(group)) for _, group in groupby(sections)]).tolist()
    return list(zip([0, *ends[:-1]], ends, strict=True))


def _turn_deg(constants: Mapping[str, Constant], source: str) -> float:
    turn = constants.get(TURN)
    if not isinstance(turn, (int, float)) or not turn:
        raise MissingConstant(
            f"{source}: the angle of each turn is unknown; give the constant turn_deg, "
            "such as --constant turn_deg=360 (-360 for the other sense of rotation), or a column of rates",
            TURN,
        )
    return float(turn)


def _length_s(
    columns: Mapping[str, Array], constants: Mapping[str, Constant], bound: tuple[int, int], source: str
) -> float:
    """Duration of a section: number of samples times sample interval. Raises MissingConstant without times and sample
    rate, DataError if the two differ.
    """
    a, b = bound
    rate_hz = constants.get("sample_rate_hz")
    if isinstance(rate_hz, (int, float)) and rate_hz > 0:
        log_rate_hz(columns.get("t_s"), float(rate_hz), source)
        return (b - a) / float(rate_hz)
    if "t_s" in columns and b - a > 1 and columns["t_s"][b - 1] > columns["t_s"][a]:
        return float((columns["t_s"][b - 1] - columns["t_s"][a]) * (b - a) / (b - a - 1))
    raise MissingConstant(
        f"{source}: a log of turns needs the column t_s, or the constant sample_rate_hz", "sample_rate_hz"
    )
