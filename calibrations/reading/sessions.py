"""A session by hand in named sections: a gyroscope laid on its faces and turned about its edges, as a table of rates.

The column `path` names the section of every sample. A section is a turn where the gyroscope's mean is far from that of
its quietest section; the constant `turn_deg` says by how much it was turned, about the edge that stood upright, by the
right hand. Its mean rate is that angle over its time, however unsteady the hand: so of a section no scatter is kept.

Source  Ferraris, Grimaldi and Parvis, Sensors and Materials 7 (1995): six faces, and one turn about each edge.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np

from calibrations.errors import DataError, MissingConstant
from calibrations.table import Array, Constant, Table

OUTPUTS = ("gx", "gy", "gz")
RATE = "rate_deg_s"
FEWEST = 20  # samples of a section, at least, in the mean: fewer are no log
APART = 0.2  # of the farthest section's distance from rest: a turn
LEAST_TURN = 10.0  # times the scatter of samples at rest: a hand turns by far more


def is_session(kind: str | None, columns: Mapping[str, Array], sections: Sequence[str] | None) -> bool:
    """Whether these are samples of rests and turns whose rates are still to be found."""
    return kind == "rates" and RATE not in columns and bool(sections) and all(name in columns for name in OUTPUTS)


def sample_rates(
    columns: Mapping[str, Array], sections: Sequence[str], known: Mapping[str, Constant], source: str
) -> Array:
    """The rate of the section that each sample is in, deg/s, shape (n,); 0 at rest. Raises DataError."""
    bounds, outputs = _bounds(sections), np.column_stack([columns[name] for name in OUTPUTS])
    quiet = min(bounds, key=lambda bound: float(outputs[bound[0] : bound[1]].std(axis=0).sum()))
    means = np.array([outputs[a:b].mean(axis=0) for a, b in bounds])
    away = np.linalg.norm(means - means[bounds.index(quiet)], axis=1)
    a, b = quiet
    if away.max() <= LEAST_TURN * float(np.linalg.norm(outputs[a:b].std(axis=0))):
        raise DataError(f"{source}: in no section was it turned: the means of gx, gy, gz are the same in all of them")
    rates = np.zeros(len(outputs))
    for (a, b), size in zip(bounds, away, strict=True):
        if size > APART * away.max():
            rates[a:b] = _turn_deg(known, source) / _length_s(columns, known, (a, b), source)
    return rates


def is_log(table: Table) -> bool:
    """Whether rows of rates are samples of named sections rather than means."""
    sections = table.labels.get("path")
    return (
        table.kind == "rates"
        and bool(sections)
        and "n" not in table
        and table.n > FEWEST * len(_bounds(sections or ()))
    )


def section_means(log: Table) -> Table:
    """The mean of each section, with the number of its samples."""
    bounds = _bounds(log.labels["path"])
    columns = {name: np.array([values[a:b].mean() for a, b in bounds]) for name, values in log.columns.items()}
    columns["n"] = np.array([float(b - a) for a, b in bounds])
    labels = {name: tuple(words[a] for a, _ in bounds) for name, words in log.labels.items()}
    constants = {name: value for name, value in log.constants.items() if name != "turn_deg"}
    return Table.from_columns("rates", columns, constants, log.source, labels)


def _bounds(sections: Sequence[str]) -> list[tuple[int, int]]:
    """First row and row after the last of each section."""
    ends = np.cumsum([len(list(group)) for _, group in groupby(sections)]).tolist()
    return list(zip([0, *ends[:-1]], ends, strict=True))


def _turn_deg(known: Mapping[str, Constant], source: str) -> float:
    turn = known.get("turn_deg")
    if not isinstance(turn, (int, float)) or not turn:
        raise MissingConstant(
            f"{source}: by how much the sensor was turned in each section is not known; give it as the constant "
            "turn_deg, such as --constant turn_deg=360 (-360 where it went round the other way), or the rates",
            "turn_deg",
        )
    return float(turn)


def _length_s(
    columns: Mapping[str, Array], known: Mapping[str, Constant], bound: tuple[int, int], source: str
) -> float:
    """Of all samples of a section, each with its share of time. Raises DataError where nothing tells it."""
    a, b = bound
    rate_hz = known.get("sample_rate_hz")
    if isinstance(rate_hz, (int, float)) and rate_hz > 0:
        return (b - a) / float(rate_hz)
    if "t_s" in columns and b - a > 1 and columns["t_s"][b - 1] > columns["t_s"][a]:
        return float((columns["t_s"][b - 1] - columns["t_s"][a]) * (b - a) / (b - a - 1))
    raise MissingConstant(
        f"{source}: a log of turns needs the column t_s, or the constant sample_rate_hz", "sample_rate_hz"
    )
