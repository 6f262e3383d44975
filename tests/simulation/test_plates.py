from __future__ import annotations

import pytest

from drivers.world.accelerometer import Plates, per_g_nm, read_v
from drivers.world.kernel import record

G_NM = per_g_nm(5500.0)


def read(plates: Plates, g: float, neighbour_g: float = 0.0, sag_nm: float = 0.0, supply_v: float = 5.0) -> float:
    return read_v(record(plates), 5500.0, g * G_NM, neighbour_g * G_NM, sag_nm, supply_v)


def square(plates: Plates) -> float:
    """Even part of the characteristic at 1 g, in V."""
    return (read(plates, 1.0) + read(plates, -1.0)) / 2 - read(plates, 0.0)


def test_the_trim_holds_whatever_the_mismatch() -> None:
    plates = Plates(zero_g_v=2.4, sensitivity_v_per_g=0.9, plate_mismatch_fraction=0.1)
    assert read(plates, 0.0) == pytest.approx(2.4)
    assert (read(plates, 1e-4) - read(plates, -1e-4)) / 2e-4 == pytest.approx(0.9, rel=1e-6)


def test_equal_plates_are_linear_whatever_the_gap() -> None:
    for g in (-1.5, -0.3, 0.7, 1.5):
        assert read(Plates(gap_um=0.1), g) == pytest.approx(2.5 + g, abs=1e-12)


def test_unequal_plates_bend_the_characteristic() -> None:
    # (u + m) / (1 + m u): the square's share of the slope is -m u
    assert square(Plates(plate_mismatch_fraction=0.05)) == pytest.approx(-0.05 * G_NM / 1000, rel=0.01)


def test_stray_capacitance_bends_it_symmetrically() -> None:
    plates = Plates(stray_fraction=1.0)
    assert square(plates) == pytest.approx(0.0, abs=1e-12)
    # 2 u / (2 + s (1 - u^2)): a cubic's share of s / (2 + s) u^2
    assert read(plates, 1.0) - 3.5 == pytest.approx((G_NM / 1000) ** 2 / 3, rel=1e-3)


def test_without_stray_capacitance_the_overlap_does_not_matter() -> None:
    assert read(Plates(overlap_loss_per_um2=40.0), 1.0, sag_nm=10.0) == pytest.approx(3.5)


def test_sag_loses_overlap_and_moves_the_trimmed_offset() -> None:
    plates = Plates(stray_fraction=1.0, overlap_loss_per_um2=40.0)
    assert read(plates, 1.0, sag_nm=10.0) - 2.5 == pytest.approx(1 - 0.004 / 3, abs=5e-5)
    shifted = Plates(stray_fraction=1.0, overlap_loss_per_um2=40.0, plate_mismatch_fraction=0.01)
    assert read(shifted, 0.0, sag_nm=10.0) != pytest.approx(2.5, abs=1e-3)


def test_a_height_step_makes_the_loss_uneven() -> None:
    plates = Plates(stray_fraction=1.0, overlap_loss_per_um2=40.0, height_step_nm=3.0)
    assert read(plates, 1.0, sag_nm=10.0) < read(plates, 1.0, sag_nm=-10.0)


def test_the_neighbour_slides_the_overlap() -> None:
    plates = Plates(stray_fraction=1.0, overlap_slide_per_um=1.0)
    gain = (read(plates, 1.0, 1.0) - 2.5) / (read(plates, 1.0, 0.0) - 2.5)
    assert gain == pytest.approx(1 + G_NM / 1000 / 3, rel=1e-4)


def test_the_output_is_a_fraction_of_the_supply() -> None:
    assert read(Plates(), 0.5, supply_v=4.5) == pytest.approx(0.9 * read(Plates(), 0.5))


def test_a_dead_band_is_blind_near_zero() -> None:
    plates = Plates(dead_band_nm=0.1)
    assert read(plates, 0.05 / G_NM) == 2.5
    assert read(plates, 1.0) == pytest.approx(read(Plates(), 1.0) - 0.1 / G_NM)


def test_the_output_is_clipped_at_the_rails() -> None:
    assert read(Plates(), 3.0) == 4.95
    assert read(Plates(), -3.0) == 0.05
