"""Records of a motion, and the rows that are made of them."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.errors import DataError, TooFewRows
from calibrations.motion.spectrum import find_records
from calibrations.motion.stretches import make_stretches
from calibrations.table import Array, Table
from tests.calibrations import shaken


def table(t_s: Array, **more: Array) -> Table:
    columns = {"t_s": t_s, "vx_v": np.zeros(len(t_s)), "displacement_m": np.zeros(len(t_s)), **more}
    return Table.from_columns("motion", columns, source="made")


T = np.arange(9000) / 1000


def test_a_gap_and_another_attitude_begin_a_record() -> None:
    late = np.where(np.arange(len(T)) >= 3000, T + 0.5, T)
    found = find_records(table(late, alpha_deg=np.where(T < 6, 45.0, 90.0)))
    assert [(r.first, r.end) for r in found] == [(0, 3000), (3000, 6000), (6000, 9000)]
    assert found[0].rate_hz == pytest.approx(1000)


def test_rounded_times_are_even_again() -> None:
    t = np.arange(9000) / 1024
    (found,) = find_records(table(np.round(t, 3)))
    np.testing.assert_allclose(found.times_s(np.round(t, 3)), t, atol=1e-3)


@pytest.mark.parametrize(
    ("t", "error", "says"),
    [
        (T[::-1], DataError, 'row 2, column "t_s" falls'),
        (np.zeros(9000), TooFewRows, "9000 samples all have the same time"),
        (T[:1500], TooFewRows, "no record lasts 2 s"),
        (T + 3e-3 * np.sin(T), DataError, "of a step off; a motion is sampled evenly"),
    ],
    ids=["falls", "stands", "short", "uneven"],
)
def test_a_table_without_a_record_is_refused_with_the_reason(t: Array, error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says):
        find_records(table(t))


def test_parts_of_a_stretch_are_its_mean_and_the_amplitudes_of_the_line() -> None:
    rows = make_stretches(shaken.record(seed=None, duration_s=6.0))
    t = rows.samples.time_s
    seen = 0.3 + 2e-3 * rows.lines[0].in_phase + 1e-3 * rows.lines[0].in_quadrature + 0 * t
    mean, in_phase, in_quadrature = rows.parts(np.column_stack([seen, seen]))[:3]
    np.testing.assert_allclose(mean, 0.3, atol=1e-5)
    np.testing.assert_allclose(in_phase, 2e-3, rtol=1e-2)
    np.testing.assert_allclose(in_quadrature, 1e-3, rtol=1e-2)


def test_white_noise_of_each_part_is_its_scatter() -> None:
    found = [make_stretches(shaken.record(seed=seed, duration_s=10.0)) for seed in range(6)]
    spread = [np.std(rows.parts(rows.samples.outputs), axis=1, ddof=1) for rows in found]
    told = [rows.white.mean(axis=1) for rows in found]
    np.testing.assert_allclose(np.mean(spread, axis=0), np.mean(told, axis=0), rtol=0.12)


def test_rows_keep_the_record_s_name_and_digest() -> None:
    raw = shaken.record(duration_s=6.0)
    rows = make_stretches(raw)
    assert (rows.digest, rows.source) == (raw.digest, raw.source)
    assert make_stretches(rows) is rows
    assert rows.number("output_per_g", 0.0) == pytest.approx(1.0, rel=0.03)
