"""What `rig fit` says of a sensor with three axes: its general calibration, and the Book's way with a magnetometer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from calibrations.fit import Fit
from calibrations.general import General, general
from calibrations.horizontal_turn import by_hand, ellipse, hard_iron
from calibrations.model import Estimate
from calibrations.table import Array, Table
from rig.cli.output import columns
from rig.cli.words import with_uncertainty

EQUATION = "G_c = M (S G_r + b)"


def lines(found: Fit) -> Iterator[str]:
    """For people; nothing for fewer axes than three."""
    made = general(found)
    if made is not None:
        beyond = f"; {', '.join(made.beyond)} not in it" if made.beyond else ""
        yield f"General calibration, {EQUATION}, from {found.table.unit} to {made.unit} (Book 17.3){beyond}:"
        yield columns(("axis", "M", "", "", "S", "b"), _rows(made))
    if found.table.content == "fields":
        yield _book(found.table)


def document(found: Fit) -> dict[str, Any]:
    """The key `calibration` of a fit's document; a standard uncertainty that is not determined is null."""
    made = general(found)
    if made is None:
        return {}
    parts = {
        "M": {"value": made.M.tolist(), "std": _nullable(made.M_std)},
        "S": {"value": np.diag(made.S).tolist(), "std": _nullable(np.diag(made.S_std))},
        "b": {"value": made.b.tolist(), "std": _nullable(made.b_std)},
    }
    units = {"from": found.table.unit, "to": made.unit}
    return {"calibration": {"equation": EQUATION, "unit": units, **parts, "beyond": list(made.beyond)}}


def _rows(made: General) -> Iterator[tuple[str, ...]]:
    for k, axis in enumerate("xyz"):
        turned = (_told(value, std) for value, std in zip(made.M[k], made.M_std[k], strict=True))
        yield axis, *turned, _told(made.S[k], made.S_std[k]), _told(made.b[k], made.b_std[k])


def _told(value: float, std: float) -> str:
    known = None if np.isnan(std) else float(std)
    return with_uncertainty(Estimate("", "", float(value), known, "")).strip()


def _nullable(std: Array) -> Any:
    return [_nullable(row) for row in std] if std.ndim > 1 else [None if np.isnan(s) else float(s) for s in std]


def _book(table: Table) -> str:
    """The Book's hard and soft iron, and what is left of the magnitude by them."""
    outputs = table.outputs
    middle = hard_iron(outputs)
    found = ellipse((outputs - middle)[:, :2])
    shown = ", ".join(f"{value:.5g}" for value in middle)
    turn = not np.ptp(outputs[:, 2]) > 0.2 * np.ptp(outputs[:, :2])
    told = f"The Book's way, from the extremes: hard iron {shown} {table.unit}"
    if turn:
        told += (
            f"; soft iron in the plane: radii {found.greatest:.5g} and {found.least:.5g} {table.unit}, the greater at "
            f"{np.degrees(found.angle_rad):.3g} deg from x"
        )
    corrected = by_hand(outputs)[:, :2] if turn else outputs - middle
    size = np.linalg.norm(corrected, axis=1)
    return f"{told}. The magnitude then varies by {1e3 * size.std() / size.mean():.3g} per mille."
