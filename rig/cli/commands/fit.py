"""fit: estimate a model's parameters from data, with uncertainties."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from calibrations.analyses.magnetometer_turn import (
    correct_by_extremes,
    estimate_hard_iron,
    fit_ellipse,
    magnitude_per_mille,
)
from calibrations.discovery.check_poses import Check, judge_check_poses
from calibrations.fitting.fit import Fit
from calibrations.fitting.matrices import CalibrationMatrices, calibration_matrices
from calibrations.geometry.sphere import Faces, estimate_faces
from calibrations.table import Array, Table
from calibrations.text import columns, concise
from rig.cli.terminal.complete import complete_data
from rig.cli.terminal.options import DataCommand, request_options
from rig.cli.terminal.output import check_option, emit, model_option, note, notes, out_option
from rig.cli.terminal.progress import working

if TYPE_CHECKING:
    from calibrations.discovery.dataset import Dataset
    from calibrations.model import Model
    from rig.services.request import Request


@click.command("fit", cls=DataCommand)
@click.argument("data", shell_complete=complete_data)
@model_option
@out_option("Write the fitted model to this file.")
@check_option
@request_options
def fit_command(request: Request, out: Path | None, check: bool, as_json: bool) -> int:
    """Estimate the parameters of a model from DATA (a file or a run), with standard uncertainties."""
    from calibrations.discovery.verdict import Verdict
    from calibrations.documents import fit_document
    from calibrations.presentation.views import view_of
    from rig.cli.terminal.words import parameters, warning
    from rig.services.load import load_request
    from rig.services.provenance import write_model

    with working("fitting the model"):
        question = load_request(request, note)
        data = question.data
        fitted = data.fit(question.model)
        path, reason = write_model(data, fitted, question.model, out, note), data.rejection(fitted)
        if (untestable := data.untestable(fitted, question.effects)) is not None:
            note(untestable)
        cautions, further = data.cautions(fitted), _further(data, question.model, fitted)
    if as_json:
        emit(fit_document(data, fitted, str(path) if path else None) | further.document)
        notes(warning(cautions))
    else:
        remarks = [*further.lines, *warning(cautions)]
        if reason is not None:
            remarks = [f"This data cannot be used: {reason.verdict}: {reason.text}."]
        click.echo(f"{fitted.model.name} fitted to {data.description}\n\n{parameters(fitted.model)}\n")
        click.echo("\n".join([columns(*view_of(data).error_table(fitted)), *(f"\n{line}" for line in remarks)]))
        if further.paper:
            click.echo(f"\n{further.paper}")
        if path is not None:
            click.echo(f"\nwritten: {path}")
    if reason is not None and reason.verdict == Verdict.NO_RESPONSE:
        return 1
    unsure = data.undetermined(fitted) is not None
    return int(check and (unsure or not data.compare(fitted.model, question.effects).adequate))


@dataclass(frozen=True)
class _Further:
    """Results of a fit to rows beyond its parameters: check poses, calibration matrices, uncertainty budget."""

    document: dict[str, Any]
    lines: tuple[str, ...] = ()
    paper: str = ""


def _further(data: Dataset[Any], model: Model, fitted: Any) -> _Further:
    if data.form != "rows":
        return _Further({})
    from calibrations.presentation.budget import budget_document as budget_of
    from rig.cli.terminal.words import paper

    checked = judge_check_poses(model, fitted.table)
    stepwise = "cross-axis-bias" in model.effects and fitted.table.type.stage_angles
    return _Further(
        check_document(checked) | calibration_document(fitted) | {"budget": budget_of(fitted)},
        (*calibration_lines(fitted), *check_lines(checked, data.source)),
        paper(fitted.table) if stepwise else "",
    )


# Check poses, which `rig plan sweep --optimal` keeps out of the fit.


def check_lines(check: Check | None, data: str) -> Iterator[str]:
    """Sentences on the check poses; none without check poses."""
    if check is None:
        return
    error = f"{check.error:.2f} times the expected error{_check_verdict(check, data)}"
    yield f"{check.poses} check poses, not used in the fit: error {error}."
    if check.repeats:
        drift = "" if check.steady else ": the sensor or the rig changes from visit to visit"
        yield f"{check.repeats} repeated poses differ by {check.pure_error:.2f} times the white noise{drift}."


def check_document(check: Check | None) -> dict[str, Any]:
    """The key `unseen` of a fit's document."""
    return {} if check is None else {"unseen": {**asdict(check), "passed": check.passed}}


def _check_verdict(check: Check, data: str) -> str:
    if check.passed:
        return ", as expected from noise"
    return f" (p = {check.chance:.0e}); the model misses an effect: rig diagnose {shlex.quote(data)}"


# Sensors with three axes: the general calibration, and the method of the Book for magnetometers.


EQUATION = "G_c = M (S G_r + b)"
FLAT = 0.2  # ratio of the range of z to that of x and y below which a turn was horizontal


def calibration_lines(fitted: Fit) -> Iterator[str]:
    """Tables and sentences; none for a sensor with fewer than three axes."""
    matrices = calibration_matrices(fitted)
    if matrices is not None:
        remark = f"; without {', '.join(matrices.beyond)}" if matrices.beyond else ""
        yield f"General calibration, {EQUATION}, from {fitted.table.unit} to {matrices.unit} (Book 17.3){remark}:"
        yield columns(("axis", "M", "", "", "S", "b"), _rows(matrices))
    if fitted.table.type.field:
        yield _book_text(fitted.table)
    if (faces := _accelerometer(fitted.table)) is not None:
        texts = (", ".join(f"{value:.7g}" for value in parts) for parts in (faces.bias, faces.scale))
        yield "The accelerometer, from its six faces: bias {}; scale factor {} per g.".format(*texts)


def calibration_document(fitted: Fit) -> dict[str, Any]:
    """The keys `calibration` and `by_hand` of the fit's document; an unknown uncertainty is null."""
    matrices, extremes = calibration_matrices(fitted), _hand_document(fitted.table)
    if (faces := _accelerometer(fitted.table)) is not None:
        extremes |= {"accelerometer": {"bias": faces.bias.tolist(), "scale_per_g": faces.scale.tolist()}}
    if matrices is None:
        return extremes
    parts = {
        "M": {"value": matrices.M.tolist(), "std": _nullable(matrices.M_std)},
        "S": {"value": np.diag(matrices.S).tolist(), "std": _nullable(np.diag(matrices.S_std))},
        "b": {"value": matrices.b.tolist(), "std": _nullable(matrices.b_std)},
    }
    units = {"from": fitted.table.unit, "to": matrices.unit}
    return {"calibration": {"equation": EQUATION, "unit": units, **parts, "beyond": list(matrices.beyond)}} | extremes


def _rows(matrices: CalibrationMatrices) -> Iterator[tuple[str, ...]]:
    for k, axis in enumerate("xyz"):
        matrix = (_estimate(value, std) for value, std in zip(matrices.M[k], matrices.M_std[k], strict=True))
        yield axis, *matrix, _estimate(matrices.S[k], matrices.S_std[k]), _estimate(matrices.b[k], matrices.b_std[k])


def _estimate(value: float, std: float) -> str:
    uncertainty = None if np.isnan(std) else float(std)
    return concise(float(value), uncertainty)


def _nullable(std: Array) -> Any:
    return [_nullable(row) for row in std] if std.ndim > 1 else [None if np.isnan(s) else float(s) for s in std]


def _accelerometer(table: Table) -> Faces | None:
    """Calibration of an accelerometer logged with a gyroscope; None without one, or if a face is missing."""
    if not table.type.turning or not all(f"a{axis}" in table for axis in "xyz"):
        return None
    still = table.column("rate_deg_s") == 0
    return estimate_faces(np.column_stack([table.column(f"a{axis}")[still] for axis in "xyz"])) if still.any() else None


def _hand_document(table: Table) -> dict[str, Any]:
    """Hard iron by the method of the Book; for a horizontal turn soft iron; then the variation of the magnitude."""
    if not table.type.field:
        return {}
    middle = estimate_hard_iron(table.outputs)
    results: dict[str, Any] = {"hard_iron": middle.tolist()}
    deviations = table.outputs - middle
    if np.ptp(table.outputs[:, 2]) < FLAT * np.ptp(table.outputs[:, :2]):
        ellipse = fit_ellipse(deviations[:, :2])
        angle = float(np.degrees(ellipse.angle_rad))
        results["hard_iron"][2] = None  # the mean of z also contains the vertical field
        results["soft_iron"] = {"greatest": ellipse.greatest, "least": ellipse.least, "angle_deg": angle}
        deviations = correct_by_extremes(table.outputs)[:, :2]
    return {"by_hand": results | {"unit": table.unit, "left_per_mille": magnitude_per_mille(deviations)}}


def _book_text(table: Table) -> str:
    """The result of the method of the Book in words."""
    values = _hand_document(table)["by_hand"]
    iron = ", ".join(f"{value:.5g}" for value in values["hard_iron"] if value is not None)
    text = f"Method of the Book, from the extremes: hard iron {iron} {table.unit}"
    if soft := values.get("soft_iron"):
        text += (
            f"; soft iron in the plane: radii {soft['greatest']:.5g} and {soft['least']:.5g} {table.unit}, the greater "
            f"at {soft['angle_deg']:.3g} deg from x. A part of this hard iron comes from the field along z, and the "
            "hard iron of z is unknown: also turn the sensor upside down and about its other edges"
        )
    return f"{text}. After this correction the magnitude varies by {values['left_per_mille']:.3g} per mille."
