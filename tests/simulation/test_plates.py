from __future__ import annotations

import pytest

from drivers.simulation.kernel import record
from drivers.simulation.plates import Plates, read_v
from drivers.simulation.springs import per_g_nm

G_NM = per_g_nm(5500.0)


def read(plates: Plates, g: float, neighbour_g: float = 0.0, sag_nm: float = 0.0, supply_v: float = 5.0) -> float:
    return read_v(record(plates), 5500.0, g * G_NM, neighbour_g * G_NM, sag_nm, supply_v)


def square(plates: Plates) -> float:
    """Even part of the characteristic at 1 g, in V."""
    return (read(plates, 1.0) + read(plates, -1.0)) / 2 - read(plates, 0.0)


def test_the_trim_holds_whatever_the_mismatch() -> None:
    plates = Plates(zero_g_v=2.4, sensitivity_v_per_g=0.9, gap_mismatch_fraction=0.1)
    assert read(plates, 0.0) == pytest.approx(2.4)
    assert (read(plates, 1e-4) - read(plates, -1e-4)) / 2e-4 == pytest.approx(0.9, rel=1e-6)


def test_centred_plates_are_linear_but_for_their_finite_gap() -> None:
    assert square(Plates()) == pytest.approx(0.0, abs=1e-12)
    relative = (read(Plates(), 1.0) - 2.5) - 1.0
    assert relative == pytest.approx((G_NM / 1000) ** 2, rel=1e-3)  # 67 uV: u + u^3


def test_a_finger_off_the_middle_bends_the_characteristic() -> None:
    # 1/(1-m-u) - 1/(1+m+u): the square's share of the slope is 3 m u to first order in m
    assert square(Plates(gap_mismatch_fraction=0.01)) == pytest.approx(3 * 0.01 * G_NM / 1000, rel=0.01)


def test_sag_loses_overlap_and_moves_the_trimmed_offset() -> None:
    plates = Plates(overlap_loss_per_um2=40.0)
    assert read(plates, 1.0, sag_nm=10.0) - 2.5 == pytest.approx((read(plates, 1.0) - 2.5) * (1 - 0.004))
    shifted = Plates(overlap_loss_per_um2=40.0, gap_mismatch_fraction=0.01)
    assert read(shifted, 0.0, sag_nm=10.0) != pytest.approx(2.5, abs=1e-3)


def test_a_height_step_makes_the_loss_uneven() -> None:
    plates = Plates(overlap_loss_per_um2=40.0, height_step_nm=3.0)
    assert read(plates, 1.0, sag_nm=10.0) < read(plates, 1.0, sag_nm=-10.0)


def test_the_neighbour_slides_the_overlap() -> None:
    plates = Plates(overlap_slide_per_um=1.0)
    gain = (read(plates, 1.0, 1.0) - 2.5) / (read(plates, 1.0, 0.0) - 2.5)
    assert gain == pytest.approx(1 + G_NM / 1000)


def test_the_output_is_a_fraction_of_the_supply() -> None:
    assert read(Plates(), 0.5, supply_v=4.5) == pytest.approx(0.9 * read(Plates(), 0.5))


def test_a_dead_band_is_blind_near_zero() -> None:
    plates = Plates(dead_band_nm=0.1)
    assert read(plates, 0.05 / G_NM) == 2.5
    assert read(plates, 1.0) == pytest.approx(read(Plates(), 1.0) - 0.1 / G_NM)


def test_the_rails_clip() -> None:
    assert read(Plates(), 3.0) == 4.95
    assert read(Plates(), -3.0) == 0.05
