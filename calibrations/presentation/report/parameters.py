"""Parts that several reports have: estimates as cells, results beside limits, matrices M, S and b, names of files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import PurePath, PureWindowsPath
from typing import Any

from markupsafe import Markup

from calibrations.fitting.fit import Fit
from calibrations.fitting.matrices import calibration_matrices
from calibrations.model import Estimate, Model
from calibrations.presentation.document import Remark, Section, Table
from calibrations.presentation.residual import column_label
from calibrations.table import AXES
from calibrations.text import as_written, bound, estimate_text, few_digits, in_prefix, minus, unit, with_times

GENERAL = Markup(
    "G<sub>c</sub> = M (S G<sub>r</sub> + b): from raw outputs G<sub>r</sub> in {raw} to G<sub>c</sub> in "
    "{calibrated}; S is diagonal. The digits in brackets are the standard uncertainty of the last digits, from the "
    "covariance of the model's parameters."
)


def estimate_cells(e: Estimate, without_std: str = "") -> tuple[str, str]:
    """Value and unit of an estimate, or why it is not identified; `without_std`: a remark where no std is known."""
    if not e.identified:
        return f"not identified: {e.why}", ""
    remark = f" ({without_std})" if without_std and not e.std else ""
    factor, prefixed_unit = in_prefix(e.value, e.std, e.unit)
    return estimate_text(e.value * factor, e.std * factor if e.std else None) + remark, unit(prefixed_unit)


def matrices_section(fit: Fit) -> Section | None:
    """The general calibration; None for a sensor with fewer than three axes, and for a motion."""
    matrices = calibration_matrices(fit)
    if matrices is None:
        return None
    raw, calibrated = unit(fit.table.unit), unit(matrices.unit)
    per_raw = f"({calibrated})/{raw}" if "/" in calibrated else f"{calibrated}/{raw}"
    rows = [
        (
            axis,
            *(estimate_text(float(m), float(std)) for m, std in zip(matrices.M[k], matrices.M_std[k], strict=True)),
            estimate_text(float(matrices.S[k]), float(matrices.S_std[k])),
            estimate_text(float(matrices.b[k]), float(matrices.b_std[k])),
        )
        for k, axis in enumerate(AXES)
    ]
    head = ("axis", "M, x", "y", "z", f"S, {per_raw}", f"b, {calibrated}")
    table = Table("General calibration", head, rows, range(1, 6), headed=False)
    text = f"Effects that these matrices cannot hold: {', '.join(matrices.beyond)}."
    remark = (Remark(text),) if matrices.beyond else ()
    return Section("General calibration", (GENERAL.format(raw=raw, calibrated=calibrated), table, *remark))


def name_of_file(source: str) -> str:
    """The name of a file without its folder: paths of this machine are private."""
    if PurePath(source).is_absolute() or PureWindowsPath(source).is_absolute():
        return PureWindowsPath(source).name
    return source


def constant_facts(constants: Mapping[str, str | float]) -> dict[str, str]:
    """The constants of data for the provenance, with labels: `constant: sample rate (Hz)`."""
    return {f"constant: {column_label(name)}": _constant_text(name, value) for name, value in constants.items()}


def _constant_text(name: str, value: str | float) -> str:
    """A number to six digits, an estimate to three; a whole one such as a serial number with all; a readable time."""
    if isinstance(value, str):
        return with_times(value)
    if name.startswith("noise_inflation"):
        return few_digits(value)
    return as_written(value) if float(value).is_integer() else minus(f"{value:.6g}")


def model_facts(model: Model) -> dict[str, str]:
    """Name and provenance of the given model; files without their folders."""
    facts = {
        f"model given: {name.replace('_', ' ')}": with_times(name_of_file(str(value)))
        for name, value in model.provenance.items()
    }
    return {"model given": model.name, **facts}


def verdicts(results: Mapping[str, Any]) -> Iterable[Section]:
    """The results of a run that have a limit, by name, each with value, std, unit, limit and verdict; none without."""
    if rows := [_verdict(name, result) for name, result in results.items() if result["limit"] is not None]:
        head = ("result", "value", "limit", "verdict")
        yield Section("Verdicts", (Table("Verdicts", head, rows, (1, 2), headed=False),))


def _verdict(name: str, result: Mapping[str, Any]) -> tuple[str, ...]:
    value, std = result["value"], result["std"]
    text = estimate_text(value, std) if std else minus(f"{value:.3g}")
    return name, f"{text} {result['unit']}", bound(value, result["limit"]), result["verdict"]
