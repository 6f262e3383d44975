"""Charts of a fleet: effects of each batch, errors of the rigs, and the spread of parameters over a batch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.fleet.batch import Population
from calibrations.fleet.rigs import RigError
from calibrations.presentation.chart import (
    BLUE,
    VERMILION,
    Axis,
    Band,
    Cells,
    Chart,
    Note,
    Panel,
    Points,
    Rule,
    single_chart,
    stack_panels,
)
from calibrations.table import Array
from calibrations.text import percent

ROW = 0.32  # inches, of an effect or a rig
WIDE = 0.28  # of a batch's place that its sensors are strewn over
MOST_DOTS = 400  # of a batch
MOST_NAMED = 6  # sensors of a batch


def shares(population: Population) -> Chart:
    """Share of each batch's sensors that have each effect."""
    effects = list(dict.fromkeys(name for batch in population.batches for name in batch.shares))
    share = np.array([[batch.shares.get(name, 0.0) for batch in population.batches] for name in effects])
    texts = [[percent(float(value)) if value else "" for value in row] for row in share]
    x = Axis(names=tuple(batch.batch or "no batch" for batch in population.batches))
    y = Axis(low=-0.5, high=len(effects) - 0.5, names=tuple(effects), reverse=True)
    return single_chart(Panel((Cells(share, texts),), x, y), ROW * len(effects) + 0.4)


def rigs(errors: Sequence[RigError]) -> Chart:
    """Every rig's errors about the median of the rigs, with expanded uncertainties."""
    names = list(dict.fromkeys((e.effect, e.parameter, e.unit) for e in errors))
    rig_names = list(dict.fromkeys(e.rig for e in errors))
    panels = []
    for effect, parameter, unit in names:
        rig_errors = [e for e in errors if (e.effect, e.parameter, e.unit) == (effect, parameter, unit)]
        place = np.array([float(rig_names.index(e.rig)) for e in rig_errors])
        value = np.array([e.value for e in rig_errors])
        colours = [VERMILION if e.beyond else BLUE for e in rig_errors]
        dots = Points(value, place, colour=colours, reach=np.array([2 * e.std for e in rig_errors]))
        y = Axis(low=-0.5, high=len(rig_names) - 0.5, names=tuple(rig_names), reverse=True)
        panels.append(Panel((Rule(0.0, "x", width=0.7), dots), Axis(), y, f"{effect}, {parameter} in {unit}"))
    return stack_panels(panels, max(0.16 * len(rig_names), 0.9) + 0.4, share_x=False)


@dataclass(frozen=True)
class Spread:
    """One quantity over a batch: value, expanded uncertainty, name of every sensor, and which are unlike the rest."""

    batch: str
    values: Array
    expanded: Array
    sensors: Sequence[str]
    outliers: NDArray[np.bool_]
    band: tuple[float, float] | None  # the range of 95 % of the batch's sensors


def spreads(quantities: Mapping[str, Sequence[Spread]]) -> Chart:
    """A panel for each quantity, in which every batch has its place."""
    batches = list(dict.fromkeys(spread.batch for batch_spreads in quantities.values() for spread in batch_spreads))
    x = Axis(low=-0.6, high=len(batches) - 0.4, names=tuple(batch or "no batch" for batch in batches))
    panels = [
        Panel(
            tuple(part for spread in batch_spreads for part in _spread(batches.index(spread.batch), spread)),
            x,
            Axis(),
            name,
        )
        for name, batch_spreads in quantities.items()
    ]
    return stack_panels(panels, 1.7)


def _spread(place: int, spread: Spread) -> Iterator[Band | Points | Note]:
    rng = np.random.default_rng(place)
    drawn_rows = np.sort(rng.permutation(len(spread.values))[:MOST_DOTS])
    drawn_rows = np.union1d(drawn_rows, np.flatnonzero(spread.outliers))
    x = place + WIDE * rng.uniform(-1, 1, len(spread.values))
    if spread.band is not None:
        low, high = (np.full(2, end) for end in spread.band)
        yield Band(np.array([place - 0.4, place + 0.4]), low, high)
    values, expanded = spread.values[drawn_rows], spread.expanded[drawn_rows]
    colours = [VERMILION if is_unlike else BLUE for is_unlike in spread.outliers[drawn_rows]]
    hover = [spread.sensors[k] for k in drawn_rows]
    yield Points(
        x[drawn_rows], values, colour=colours, size=4, low=values - expanded, high=values + expanded, hover=hover
    )
    for k in np.flatnonzero(spread.outliers)[:MOST_NAMED]:
        yield Note(spread.sensors[k], float(x[k]), float(spread.values[k]), vertical="middle")
