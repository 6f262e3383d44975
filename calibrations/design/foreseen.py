"""The table that planned poses would give, before anything is measured: what a design of experiments is judged on.

Outputs are those of the fitted model, without noise. Noise enters as a table has it, by the standard deviation of
single samples and how many are averaged, both as in the data of the fit, so that a longer dwell counts for what it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from calibrations.chain import forward
from calibrations.errors import DataError, MissingColumn
from calibrations.fit import Fit
from calibrations.table import OUTPUTS, Array, Table

PLANNED = ("t_s", "direction")  # a plan's own: no mean of other data stands for them


def foreseen(like: Fit, columns: Mapping[str, Array]) -> Table:
    """The table of poses that planned `columns` would give a sensor such as that of `like`.

    `columns`, each of shape (n,): alpha_deg and beta_deg, and what else is planned of direction, flip, mount_deg, t_s,
    temperature_c, ...; `n` samples a mean, or `dwell_s` at the data's sample rate, else as many as the data's. Columns
    that the model's effects need and nobody plans, such as temperature_c, are held at their mean in the data.
    Constants (filter corner, gravity, approach) are the data's.

    Raises DataError for a fit to another kind of table, and for `dwell_s` where no sample rate is known; MissingColumn
    for a time or a direction that the model needs.
    """
    data = like.table
    if data.kind != "poses":
        raise DataError(f"{data.source}: a fit to {data.kind} foresees no poses; fit the model to poses")
    names = OUTPUTS["poses"][: len(data.axes)]
    given = {name: np.asarray(values, dtype=np.float64) for name, values in columns.items() if name != "dwell_s"}
    rows = len(given["alpha_deg"])
    held = {name: np.full(rows, np.mean(data.column(name))) for name in _needed(like) if name not in given}
    made = held | _noise(like, columns, rows) | given | {name: np.zeros(rows) for name in names}
    table = Table.from_columns("poses", made, data.constants, f"a plan like {data.source}")
    _check_planned(like, table)
    outputs = forward(table, like.problem.layout.steps(like.theta))
    return replace(table, columns={**table.columns, **dict(zip(names, outputs.T, strict=True))})


def _needed(like: Fit) -> set[str]:
    """Columns of the data that the model's effects read, and that a plan need not know."""
    return {name for term in like.model.terms for name in term.effect.needs} - set(PLANNED)


def _check_planned(like: Fit, table: Table) -> None:
    for term in like.model.terms:
        if why := term.effect.excluded(table):
            raise MissingColumn(f"{table.source}: {term.name} {why}; plan it")


def _noise(like: Fit, columns: Mapping[str, Array], rows: int) -> dict[str, Array]:
    """Standard deviation of samples, and how many a mean is of; nothing where the data does not tell."""
    data = like.table
    usual = {name: float(np.median(data.column(name))) for name in _std_names(data)}
    if "n" in data and "n" not in columns:
        usual["n"] = float(np.median(data.column("n")))
    noise = {name: np.full(rows, value) for name, value in usual.items()}
    if "dwell_s" not in columns:
        return noise
    rate_hz = data.number("sample_rate_hz", 0.0)
    if not rate_hz:
        raise DataError(f"{data.source}: no sample rate is known; plan `n`, or give `# sample_rate_hz: 1000`")
    return noise | {"n": np.maximum(np.round(np.asarray(columns["dwell_s"]) * rate_hz), 1.0)}


def _std_names(data: Table) -> list[str]:
    return [name for axis in data.axes if (name := f"v{axis}_std_v") in data]
