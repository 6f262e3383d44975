"""Dead zones of the search: about 0 g, and about another specific force that the residual shows.

A sensor does not respond while what drives it is small. That is at 0 g, unless an offset acts before the threshold. The
residual then has a step at another force, which no smooth function follows: a scan finds where.
"""

from __future__ import annotations

import numpy as np

from calibrations.criteria import SIGNIFICANT
from calibrations.free_forms.chain import State
from calibrations.free_forms.components import Basis, Component, Make, per_axis
from calibrations.free_forms.poses import PoseData
from calibrations.geometry.smooth import smooth_columns
from calibrations.table import Array

WIDTHS_G = (0.003, 0.012, 0.05)
CENTRES = 400  # forces that are tried on each axis
MOST_OFFSET = 0.5  # of the largest force: a sensor has a smaller offset, and a saturation begins beyond
FINER = np.geomspace(0.3, 3.0, 13)  # of a width, beside the best one
LEAST_SHARE = 0.25  # of what smooth functions leave of an axis: a step explains less of other effects
PLACE = "own-response"


def dead_zones(data: PoseData, first: State) -> list[Component]:
    """Dead zones about 0 g, one of each width, and one about other forces if the residual of `first` shows it."""
    name = f"{PLACE}/dead-zone@"
    zeros = (0.0,) * data.channels
    price = 2 * np.log(len(WIDTHS_G))
    found = [_make(data, f"{name}{width:.4f}", price, zeros)((width,) * data.channels) for width in WIDTHS_G]
    off_centre = _find_off_centre(data, first)
    if off_centre is not None:
        price = 2 * np.log(len(WIDTHS_G) * CENTRES)
        found.append(_make(data, f"{name}off-centre", price)(off_centre))
    return found


def _make(data: PoseData, name: str, price: float, about: tuple[float, ...] = ()) -> Make:
    """A dead zone of a shape: a width of each axis, and its centre where they are not `about` given forces, g."""

    def at(shape: tuple[float, ...]) -> Component:
        widths, centres = shape[: data.channels], about or shape[data.channels :]
        named = zip(data.axes, widths, centres, strict=True)
        constants = [(f"centre_{axis}", centre) for axis, _, centre in named]
        return Component(
            name, PLACE, "response", "dead-zone", f"{PLACE}/dead-zone", price, per_axis(_clipped(widths, centres)),
            shape=shape, step=tuple(0.3 * abs(widths[k % data.channels]) for k in range(len(shape))),
            reshaped=_make(data, name, price, about), constants=() if about else tuple(constants),
            starts=lambda _: tuple(("width", axis, abs(w)) for axis, w in zip(data.axes, widths, strict=True)),
        )  # fmt: skip

    return at


def _clipped(widths: tuple[float, ...], centres: tuple[float, ...]) -> Basis:
    """Specific force from the centre, clipped at the width, g, each channel's own."""
    return lambda s, k: np.clip(s.force[:, k, None] - centres[k], -abs(widths[k]), abs(widths[k]))


def _find_off_centre(data: PoseData, first: State) -> tuple[float, ...] | None:
    """Widths and centres of the dead zones that the axes show; 0 g where one shows none, None where all do."""
    smooth = np.column_stack([np.ones(data.n), smooth_columns(data.table)])
    Q = np.linalg.qr(smooth / np.maximum(np.linalg.norm(smooth, axis=0), np.finfo(float).tiny))[0]
    residual = data.outputs - first.predicted
    found = [_scan(first.force[:, k], residual[k], Q) for k in range(data.channels)]
    if all(centre == 0 for _, centre in found):
        return None
    return (*(width for width, _ in found), *(centre for _, centre in found))


def _scan(force: Array, residual: Array, Q: Array) -> tuple[float, float]:
    """Width and centre of the dead zone that explains most of a residual (n,) beside smooth functions Q.

    Its centre is 0 where it explains too little to be told from noise or from a remainder of another effect.
    """
    levels = np.unique(np.round(force, 6))
    middles = (levels[1:] + levels[:-1]) / 2
    middles = middles[np.abs(middles) < MOST_OFFSET * float(np.max(np.abs(force)))]
    coarse = middles[:: max(1, -(-len(middles) // CENTRES))]
    if not len(coarse):
        return WIDTHS_G[1], 0.0
    left = residual - Q @ (Q.T @ residual)

    def scan(widths: Array, centres: Array) -> tuple[float, float, float]:
        """The largest square that a dead zone explains, with its width and centre."""
        best = (0.0, WIDTHS_G[1], 0.0)
        for width in widths:
            columns = np.clip(force[:, None] - centres, -width, width)
            columns -= Q @ (Q.T @ columns)
            gains = (columns.T @ left) ** 2 / np.maximum(np.sum(columns**2, axis=0), 1e-12 * width**2)
            k = int(np.argmax(gains))
            best = max(best, (float(gains[k]), float(width), float(centres[k])))
        return best

    gain, width, centre = scan(np.array(WIDTHS_G), coarse)
    about = max(width, float(np.ptp(levels)) / max(len(coarse), 1))
    gain, width, centre = scan(width * FINER, centre + about * np.linspace(-1, 1, 41))
    squares = float(left @ left)
    share = gain / squares if squares > 0 else 0.0
    price = 2 * np.log(len(WIDTHS_G) * CENTRES / SIGNIFICANT)
    is_clear = share >= LEAST_SHARE and -len(force) * np.log1p(-min(share, 1 - 1e-12)) > price
    return (width, centre) if is_clear else (WIDTHS_G[1], 0.0)
