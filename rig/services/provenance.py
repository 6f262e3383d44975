"""The origin of a result: program and date; model files with their provenance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from calibrations.discovery.dataset import Dataset
from calibrations.discovery.findings import F
from calibrations.discovery.verdict import Verdict
from calibrations.errors import UnusableData
from calibrations.model import Model
from calibrations.model.file import dump_model
from rig.files import program, write_whole

SENSOR_CONSTANTS = ("sensor", "serial", "gravity_m_s2")  # constants of the data that a model file keeps


def today() -> str:
    """The date of today, ISO 8601, UTC."""
    return datetime.now(UTC).date().isoformat()


def with_provenance(kind: Dataset[F], fitted: F, parent: Model) -> Model:
    """The model that was fitted to data of this kind, with its data, parent and program. Raises UnusableData."""
    data = fitted.measured
    if (reason := kind.rejection(fitted)) is not None and reason.verdict == Verdict.NO_RESPONSE:
        raise UnusableData(f"{data.source}: no model is written: {reason.text}")
    return replace(
        fitted.model,
        provenance={
            "data": data.source,
            "data_sha256": data.digest,
            "rows": data.n,
            **{name: data.constants[name] for name in SENSOR_CONSTANTS if name in data.constants},
            "parent": parent.name,
            "program": program(),
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "excess": round(fitted.pooled_excess, 4),
        },
        covered=kind.covered(fitted),
        correlations=kind.correlations(fitted),
    )


def write_model(
    kind: Dataset[F], fitted: F, parent: Model, out: Path | None, notify: Callable[[str], None]
) -> Path | None:
    """Write the fitted model with its provenance to `out`, completely or not at all. Returns the path.

    None without `out`, and if an output does not respond: such a model cannot correct anything, and `notify`
    receives the reason.
    """
    if out is None:
        return None
    try:
        write_whole(out, dump_model(with_provenance(kind, fitted, parent)))
    except UnusableData as error:
        notify(str(error))
        return None
    return out
