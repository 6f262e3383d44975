from __future__ import annotations

from math import cos, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.world.gravity import Base, Package, along_y, felt_g, mounting, rotation, vertical
from drivers.world.kernel import record

LEVEL, SQUARE = Base(), Package()
angle = st.floats(-360, 360)


def felt(alpha: float, beta: float, base: Base = LEVEL, package: Package = SQUARE, mount=0.0, flip=0):
    up, mounted = vertical(base), mounting(package, mount, flip)
    return np.array(felt_g(up, mounted, radians(alpha), radians(beta)))


@given(alpha=angle, beta=angle)
def test_a_perfect_rig_gives_the_convention(alpha: float, beta: float) -> None:
    a, b = radians(alpha), radians(beta)
    assert felt(alpha, beta) == pytest.approx([sin(a) * cos(b), sin(a) * sin(b), cos(a)], abs=1e-12)


@given(alpha=angle, beta=angle, tilt=angle, turn=angle, mount=angle, flip=st.integers(0, 1))
def test_rotations_keep_the_magnitude_of_gravity(
    alpha: float, beta: float, tilt: float, turn: float, mount: float, flip: int
) -> None:
    g = felt(alpha, beta, Base(tilt, turn), Package(turn, tilt, turn), mount, flip)
    assert np.linalg.norm(g) == pytest.approx(1.0)


def test_face_down_turns_about_x() -> None:
    assert felt(50, 20, flip=1) == pytest.approx(felt(50, 20) * [1, -1, -1])


def test_the_mount_angle_adds_to_beta() -> None:
    assert felt(70, 20, mount=15) == pytest.approx(felt(70, 35))


def test_the_rotation_of_the_package_is_the_last() -> None:
    package = Package(turn_x_deg=1.0, turn_y_deg=2.0, turn_z_deg=3.0)
    assert felt(70, 20, package=package, flip=1) == pytest.approx(rotation(1, 2, 3) @ felt(70, 20, flip=1))


def test_tilt_about_y_adds_to_alpha() -> None:
    assert felt(70, 20, base=Base(tilt_y_deg=0.5)) == pytest.approx(felt(70.5, 20))


def test_beams_off_square_mix_x_into_y() -> None:
    off = record(Package(beams_off_square_deg=1.0))
    assert along_y(off, 1.0, 0.0) == pytest.approx(sin(radians(1.0)))
    assert along_y(off, 0.0, 1.0) == pytest.approx(cos(radians(1.0)))
