"""fit: estimate a model's parameters from data, with uncertainties."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from calibrations.analyses.magnetometer_turn import correct_by_extremes, estimate_hard_iron, fit_ellipse
from calibrations.analyses.tumble import Faces, estimate_faces
from calibrations.discovery.check_poses import Check
from calibrations.fit import Fit
from calibrations.fitting.matrices import CalibrationMatrices, calibration_matrices
from calibrations.presentation.text import columns, concise
from calibrations.table import Array, Table
from rig.cli.terminal.options import request_options
from rig.cli.terminal.output import check_option, emit, model_option, note, notes

if TYPE_CHECKING:
    from calibrations.discovery.dataset import Dataset
    from calibrations.model import Model
    from rig.services.request import Request


@click.command("fit")
@click.argument("data")
@model_option
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Write the fitted model to this file.")
@check_option
@request_options
def command(request: Request, out: Path | None, check: bool, as_json: bool) -> int:
    """Estimate the parameters of a model from DATA (a file or a run), with standard uncertainties."""
    from calibrations.discovery.verdict import Verdict
    from calibrations.documents import fit_document
    from rig.cli.terminal.words import parameters, table, warning
    from rig.services.load import loaded
    from rig.services.provenance import write_model

    question = loaded(request, note, out)
    data = question.data
    found = data.fit(question.model)
    written, reason = write_model(found, question.model, out, note), data.rejection(found)
    if (untestable := data.untestable(found, question.effects)) is not None:
        note(untestable)
    cautions, further = data.cautions(found), _further(data, question.model, found)
    if as_json:
        emit(fit_document(data, found, str(written) if written else None) | further.document)
        notes(warning(cautions))
    else:
        remarks = [*further.lines, *warning(cautions)]
        if reason is not None:
            remarks = [f"This data cannot be used: {reason.verdict}: {reason.text}."]
        click.echo(f"{found.model.name} fitted to {data.description}\n\n{parameters(found.model)}\n")
        click.echo("\n".join([table(data.error_table(found)), *(f"\n{line}" for line in remarks)]))
        if further.paper:
            click.echo(f"\n{further.paper}")
        if written is not None:
            click.echo(f"\nwritten to {written}")
    if reason is not None and reason.verdict == Verdict.NO_RESPONSE:
        return 1
    unsure = data.undetermined(found) is not None
    return int(check and (unsure or not data.compare(found.model).adequate))


@dataclass(frozen=True)
class _Further:
    """What a fit of rows says beyond its parameters: check poses, calibration matrices, uncertainty budget."""

    document: dict[str, Any]
    lines: tuple[str, ...] = ()
    paper: str = ""


def _further(data: Dataset[Any], model: Model, found: Any) -> _Further:
    if data.form != "rows":
        return _Further({})
    from calibrations.discovery.check_poses import unseen
    from calibrations.presentation.report.parameters import budget_document as in_parts
    from rig.cli.terminal.words import paper

    checked = unseen(model, found.table)
    stepwise = "cross-axis-bias" in model.effects and found.table.type.stage_angles
    return _Further(
        check_document(checked) | calibration_document(found) | {"budget": in_parts(found)},
        (*calibration_lines(found), *check_lines(checked, data.source)),
        paper(found.table) if stepwise else "",
    )


# What check poses say of a model, in words and as JSON: those that `rig plan sweep --optimal` keeps out of the fit.


def check_lines(check: Check | None, data: str) -> Iterator[str]:
    """For people; nothing where there is nothing to check on."""
    if check is None:
        return
    poses = f"{check.poses} check poses, which a fit to the others has not seen,"
    yield f"{poses} are missed by {check.error:.2f} x what is foreseen{_verdict(check, data)}."
    if check.repeats:
        differ = f"{check.repeats} repeats of poses differ by {check.pure_error:.2f} x what white noise makes"
        yield f"{differ}{_visits(check)}."


def check_document(check: Check | None) -> dict[str, Any]:
    """The key `unseen` of a fit's document."""
    return {} if check is None else {"unseen": {**asdict(check), "passed": check.passed}}


def _verdict(check: Check, data: str) -> str:
    if check.passed:
        return ": no more than noise"
    return f" (chance {check.chance:.0e}): the model misses something, see rig diagnose {data}"


def _visits(check: Check) -> str:
    return "" if check.steady else ": something changes from visit to visit"


# What `rig fit` says of a sensor with three axes: its general calibration, and the Book's way with a magnetometer.


EQUATION = "G_c = M (S G_r + b)"
FLAT = 0.2  # of the range of the other two outputs, by that of z: then it was a horizontal turn


def calibration_lines(found: Fit) -> Iterator[str]:
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


def calibration_document(found: Fit) -> dict[str, Any]:
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
