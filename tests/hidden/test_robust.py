"""Data as they come: what is wrong with them is said, what the rig has is named, and nothing else is."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from calibrations.discovery.outliers import gross
from calibrations.discovery.results import Discovery
from calibrations.documents import diagnosis_document
from calibrations.fitting.fit import fit
from calibrations.loop import diagnose, discover
from calibrations.means.noise import white_std
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.hidden import rigs, sampled
from tests.hidden.intervals import CAUSES
from tests.slow import first_fast

KNOWN = {"sample_rate_hz": 1000.0, "filter_corner_hz": 15.07}


def world(defect: str | None, seed: int) -> Table:
    columns = rigs.clean_rig(seed) if defect is None else rigs.rig_with(defect, 10.0, seed)
    return Table.from_columns("poses", {k: v for k, v in columns.items() if v.dtype.kind in "fi"}, KNOWN, "world")


def by_samples(effect: str | None, seed: int) -> Table:
    return sampled.measured(seed, CAUSES[effect].law if effect else None)


# what makes the table, and what it is to be called
SUBJECTS: dict[str, tuple[Callable[[], Table], tuple[str, ...]]] = {
    "world, clean": (lambda: world(None, 1), ()),
    "world": (lambda: world("plate mismatch", 1), ("quadratic-nonlinearity",)),
    "samples, clean": (lambda: by_samples(None, 2), ()),
    "samples": (lambda: by_samples("temperature-bias", 2), ("temperature-bias",)),
}


def changed(table: Table, columns: Mapping[str, Array | None]) -> Table:
    kept = {name: values for name, values in {**table.columns, **columns}.items() if values is not None}
    return Table.from_columns(table.kind, kept, table.constants, table.source)


def found(table: Table) -> Discovery:
    return discover(table, read_model("linear"))


def knocked(table: Table, seed: int = 3) -> tuple[Table, list[int]]:
    """One pose in fifty is off by 5 to 200 mV, on either axis."""
    rng = np.random.default_rng(seed)
    rows = np.sort(rng.choice(table.n, table.n // 50, replace=False))
    columns = {name: table.column(name).copy() for name in ("vx_v", "vy_v")}
    for values in columns.values():
        values[rows] += rng.choice([-1, 1], len(rows)) * rng.uniform(5e-3, 0.2, len(rows))
    return changed(table, columns), [int(row) for row in rows]


@pytest.mark.parametrize("subject", first_fast(["samples, clean", "world"]))
def test_gross_outliers_are_listed_and_spoil_nothing(subject: str) -> None:
    make, causes = SUBJECTS[subject]
    table, rows = knocked(make())
    result, clean = found(table), found(make())
    assert result.causes == causes
    assert list(result.outliers) == rows
    assert all(f"#{row}" in str(result.caution) for row in rows)
    assert "counted from 0" in str(result.caution)
    assert "rig exclude" in str(result.caution)
    std = np.array([e.std for term in clean.end.model.terms for e in term.estimates], dtype=float)
    assert np.all(np.abs(result.end.theta - clean.end.theta) < std)
    assert (result.verdict == "unexplained") == (not causes)
    assert (result.residual_structure is None) == bool(causes)


def test_outliers_keep_their_numbers_when_other_poses_are_left_out() -> None:
    table, rows = knocked(world("plate mismatch", 4))
    out = next(row for row in range(table.n) if row not in rows)
    result = diagnose(table.rows(np.delete(np.arange(table.n), out)), read_model("linear"))
    assert list(result.outliers) == rows


@pytest.mark.slow
def test_a_diagnosis_lists_outliers_too() -> None:
    table, rows = knocked(world("plate mismatch", 4))
    result = diagnose(table, read_model("linear"))
    assert "quadratic-nonlinearity" in (result.candidates[0].name, *result.candidates[0].indistinguishable_from)
    assert diagnosis_document(result, "linear")["outliers"] == rows
    assert f"{len(rows)} poses differ from the others" in str(result.caution)
    clean, rows = knocked(world(None, 4))
    numbers = ", ".join(f"#{row}" for row in rows)
    expected = f"{len(rows)} poses differ from the others: {numbers}"
    assert diagnose(clean, read_model("linear")).residual_structure == expected


@pytest.mark.parametrize("defect", ["slipping contacts", "blind amplifier", "gear play", "creeping charge"])
def test_poses_of_a_large_effect_are_no_outliers(defect: str) -> None:
    columns = rigs.rig_with(defect, 100.0, 1)
    table = Table.from_columns("poses", {k: v for k, v in columns.items() if v.dtype.kind in "fi"}, KNOWN)
    assert not len(gross(fit(read_model("linear"), table)))


def stretch_missing(table: Table) -> Table:
    return table.rows((np.arange(table.n) < 120) | (np.arange(table.n) > 210))


def of_unequal_n(table: Table) -> Table:
    """Dwells of a twentieth of the time and more: their means scatter by as much more."""
    rng, less, white = np.random.default_rng(5), None, white_std(table)
    assert white is not None
    less = rng.uniform(0.05, 1.0, table.n)
    more = np.sqrt(1 / less - 1)[:, None] * white * rng.standard_normal(white.shape)
    volts = {name: table.column(name) + more[:, k] for k, name in enumerate(("vx_v", "vy_v"))}
    return changed(table, {**volts, "n": np.maximum(np.round(table.column("n") * less), 2)})


def copied(table: Table) -> Table:
    """Rows that stand there twice."""
    rows = np.sort(np.concatenate([np.arange(table.n), np.arange(0, table.n, 13)]))
    return table.rows(rows)


def of_one_axis(table: Table) -> Table:
    return changed(table, {"vy_v": None, "vy_std_v": None})


def of_three_axes(table: Table) -> Table:
    white = white_std(table)
    assert white is not None
    vz = 2.5 + 0.98 * np.cos(np.radians(table.column("alpha_deg")))
    vz = vz + white[:, 0] * np.random.default_rng(6).standard_normal(table.n)
    return changed(table, {"vz_v": vz, "vz_std_v": table.column("vx_std_v")})


@pytest.mark.slow
@pytest.mark.parametrize("spoilt", [stretch_missing, of_unequal_n, copied, of_one_axis, of_three_axes])
@pytest.mark.parametrize("subject", first_fast(["samples, clean", "world"]))
def test_what_the_rig_has_is_named_all_the_same(subject: str, spoilt: Callable[[Table], Table]) -> None:
    make, causes = SUBJECTS[subject]
    result = found(spoilt(make()))
    assert result.causes == causes
    assert result.verdict == "adequate" or any(set(causes) & set(result.alternatives))


@pytest.mark.parametrize("subject", first_fast(["samples, clean", "samples"]))
def test_an_unlogged_temperature_is_not_called_a_drift_for_certain(subject: str) -> None:
    make, causes = SUBJECTS[subject]
    result = found(changed(make(), {"temperature_c": None}))
    if not causes:
        assert (result.verdict, result.causes) == ("adequate", ())
        return
    assert result.verdict in ("ambiguous", "unexplained")
    assert all("temperature-bias" in result.alternatives[name] for name in result.causes)
    if result.next_experiment:
        assert "thermometer" in result.next_experiment.why


@pytest.mark.slow
@pytest.mark.parametrize("subject", first_fast(["world, clean", "world"]))
def test_an_unknown_filter_is_no_effect(subject: str) -> None:
    """Correlated samples taken as independent make means look four times too good: they scatter, that is all."""
    make, causes = SUBJECTS[subject]
    table = make()
    blind = Table.from_columns(table.kind, table.columns)
    assert fit(read_model("linear"), blind).pooled_excess > 4
    result, informed = found(blind), found(table)
    assert result.causes == informed.causes == causes
    assert (result.verdict, result.alternatives) == (informed.verdict, informed.alternatives)
