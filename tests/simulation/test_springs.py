from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.world.accelerometer import Springs, balanced_nm, per_g_nm, restoring_nm, shift_nm
from drivers.world.kernel import record

PLAIN = Springs()
load = st.floats(-1.5, 1.5)


def balanced(x: Springs, gx: float, gy: float = 0.0, y: Springs = PLAIN, warmer_k: float = 0.0):
    return balanced_nm(record(x), record(y), gx, gy, warmer_k)


def test_displacement_per_g_follows_from_the_resonance() -> None:
    assert per_g_nm(5500.0) == pytest.approx(8.21, abs=0.01)


def test_plain_springs_are_linear() -> None:
    assert balanced(Springs(), 0.5, -0.25) == pytest.approx((0.5 * per_g_nm(5500.0), -0.25 * per_g_nm(5500.0)))


@given(gx=load, gy=load, hard=st.floats(-50, 50), side=st.floats(-0.01, 0.01), pull=st.floats(-0.02, 0.02))
def test_forces_of_springs_and_load_balance(gx: float, gy: float, hard: float, side: float, pull: float) -> None:
    springs = Springs(
        hardening_per_um2=hard, one_sided_fraction=side, coupling_fraction=pull, stiffening_ppm_per_k=-100.0
    )
    x, y = balanced(springs, gx, gy, springs, 10.0)
    for own, other, g in ((x, y, gx), (y, x, gy)):
        force = restoring_nm(record(springs), own, 10.0)[0] + pull * other
        assert force == pytest.approx(g * per_g_nm(5500.0), abs=1e-6)


def test_hardening_bends_less_and_one_sided_bends_unevenly() -> None:
    assert balanced(Springs(hardening_per_um2=50.0), 1.0)[0] < per_g_nm(5500.0)
    uneven = Springs(one_sided_fraction=0.02)
    assert balanced(uneven, 1.0)[0] == pytest.approx(per_g_nm(5500.0) / 1.01)
    assert balanced(uneven, -1.0)[0] == pytest.approx(-per_g_nm(5500.0) / 0.99)


def test_springs_soften_with_temperature() -> None:
    warm = balanced(Springs(stiffening_ppm_per_k=-100.0), 1.0, warmer_k=10.0)[0]
    assert warm == pytest.approx(per_g_nm(5500.0) / 0.999)


def test_foreshortening_follows_squares_tilt_and_stress_their_causes() -> None:
    springs = record(Springs(foreshortening_per_um=1.0, sag_foreshortening_per_um=2.0))
    assert shift_nm(springs, 8.0, 10.0, 5.0) == pytest.approx(0.064 + 0.2)
    assert shift_nm(springs, -8.0, -10.0, 5.0) == pytest.approx(0.064 + 0.2)
    springs = record(Springs(sag_tilt_fraction=0.01, stress_pm_per_k=3.0))
    assert shift_nm(springs, 8.0, 10.0, 5.0) == pytest.approx(0.1 + 0.015)
