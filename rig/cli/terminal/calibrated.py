"""What `rig fit` says of a sensor with three axes: its general calibration, and the Book's way with a magnetometer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from calibrations.analyses.magnetometer_turn import correct_by_extremes, estimate_hard_iron, fit_ellipse
from calibrations.analyses.tumble import Faces, estimate_faces
from calibrations.fit import Fit
from calibrations.fitting.matrices import CalibrationMatrices, calibration_matrices
from calibrations.presentation.text import columns, concise
from calibrations.table import Array, Table

EQUATION = "G_c = M (S G_r + b)"
FLAT = 0.2  # of the range of the other two outputs, by that of z: then it was a horizontal turn


def lines(found: Fit) -> Iterator[str]:
    """For people; nothing for fewer axes than three."""
    made = calibration_matrices(found)
    if made is not None:
        beyond = f"; {', '.join(made.beyond)} not in it" if made.beyond else ""
        yield f"General calibration, {EQUATION}, from {found.table.unit} to {made.unit} (Book 17.3){beyond}:"
        yield columns(("axis", "M", "", "", "S", "b"), _rows(made))
    if found.table.type.field:
        yield _book(found.table)
    if (held := _held(found.table)) is not None:
        shown = (", ".join(f"{value:.7g}" for value in each) for each in (held.bias, held.scale))
        yield "The accelerometer beside it, by its six faces: bias {}; {} a g.".format(*shown)


def document(found: Fit) -> dict[str, Any]:
    """The keys `calibration` and `by_hand` of a fit's document; an uncertainty that is not determined is null."""
    made, extremes = calibration_matrices(found), _by_hand(found.table)
    if (held := _held(found.table)) is not None:
        extremes |= {"accelerometer": {"bias": held.bias.tolist(), "scale_per_g": held.scale.tolist()}}
    if made is None:
        return extremes
    parts = {
        "M": {"value": made.M.tolist(), "std": _nullable(made.M_std)},
        "S": {"value": np.diag(made.S).tolist(), "std": _nullable(np.diag(made.S_std))},
        "b": {"value": made.b.tolist(), "std": _nullable(made.b_std)},
    }
    units = {"from": found.table.unit, "to": made.unit}
    return {"calibration": {"equation": EQUATION, "unit": units, **parts, "beyond": list(made.beyond)}} | extremes


def _rows(made: CalibrationMatrices) -> Iterator[tuple[str, ...]]:
    for k, axis in enumerate("xyz"):
        turned = (_told(value, std) for value, std in zip(made.M[k], made.M_std[k], strict=True))
        yield axis, *turned, _told(made.S[k], made.S_std[k]), _told(made.b[k], made.b_std[k])


def _told(value: float, std: float) -> str:
    known = None if np.isnan(std) else float(std)
    return concise(float(value), known)


def _nullable(std: Array) -> Any:
    return [_nullable(row) for row in std] if std.ndim > 1 else [None if np.isnan(s) else float(s) for s in std]


def _held(table: Table) -> Faces | None:
    """What an accelerometer shows that was read beside a gyroscope; None where there is none, or a face is missing."""
    if not table.type.turning or not all(f"a{axis}" in table for axis in "xyz"):
        return None
    still = table.column("rate_deg_s") == 0
    return estimate_faces(np.column_stack([table.column(f"a{axis}")[still] for axis in "xyz"])) if still.any() else None


def _by_hand(table: Table) -> dict[str, Any]:
    """The Book's hard iron and, of a horizontal turn, soft iron, and what they leave of the magnitude."""
    if not table.type.field:
        return {}
    middle = estimate_hard_iron(table.outputs)
    told: dict[str, Any] = {"hard_iron": middle.tolist()}
    left = table.outputs - middle
    if np.ptp(table.outputs[:, 2]) < FLAT * np.ptp(table.outputs[:, :2]):
        found = fit_ellipse(left[:, :2])
        angle = float(np.degrees(found.angle_rad))
        told["hard_iron"][2] = None  # the middle of z is the field that stands upright, too
        told["soft_iron"] = {"greatest": found.greatest, "least": found.least, "angle_deg": angle}
        left = correct_by_extremes(table.outputs)[:, :2]
    size = np.linalg.norm(left, axis=1)
    return {"by_hand": told | {"unit": table.unit, "left_per_mille": float(1e3 * size.std() / size.mean())}}


def _book(table: Table) -> str:
    """The same for people."""
    told = _by_hand(table)["by_hand"]
    shown = ", ".join(f"{value:.5g}" for value in told["hard_iron"] if value is not None)
    text = f"The Book's way, from the extremes: hard iron {shown} {table.unit}"
    if soft := told.get("soft_iron"):
        text += (
            f"; soft iron in the plane: radii {soft['greatest']:.5g} and {soft['least']:.5g} {table.unit}, the greater "
            f"at {soft['angle_deg']:.3g} deg from x. In the hard iron is what iron makes of the field along z, and of "
            "z itself nothing is known: turn the sensor over, and about its other edges"
        )
    return f"{text}. The magnitude then varies by {told['left_per_mille']:.3g} per mille."
