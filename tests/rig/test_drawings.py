"""Drawings of the rig: the geometry of the sensor, valid SVG without foreign parts, and what a technician must see."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from calibrations.text import minus
from procedures.catalogue import SHIPPED
from procedures.questions import Confirm, Mounting
from rig.drawings import Attitude, drawing_of, page, sketch, strip, svg
from rig.drawings.attitude import NAMED
from rig.drawings.rig_view import CAMERA_FROM, Camera, box, cylinder
from tests.rig.conftest import Rig

SVG = "{http://www.w3.org/2000/svg}"
ANGLES = product((-135.0, 0.0, 90.0, 180.0), (0.0, 200.0), (0.0, 45.0), (0, 1))
EVERYWHERE = [*(Attitude(*angles) for angles in ANGLES), Attitude(45, 90, shaken=True)]


def test_the_specific_force_agrees_with_the_geometry() -> None:
    for alpha, beta in product((-150.0, 0.0, 45.0, 90.0), (-30.0, 0.0, 90.0, 210.0)):
        a, b = np.radians([alpha, beta])
        wanted = np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)
        assert Attitude(alpha, beta).specific_force_g == pytest.approx(wanted, abs=1e-9)
        x, y, z = wanted
        assert Attitude(alpha, beta, flip=1).specific_force_g == pytest.approx((x, -y, -z), abs=1e-9)
    assert Attitude(90, 30, mount_deg=60).specific_force_g == pytest.approx((0, 1, 0), abs=1e-9)


@pytest.mark.parametrize("draw", [page, strip])
@pytest.mark.parametrize(
    "attitude", EVERYWHERE, ids=lambda a: f"{a.alpha_deg:g}-{a.beta_deg:g}-{a.mount_deg:g}-{a.flip}"
)
def test_a_drawing_is_one_valid_file_within_its_frame(attitude: Attitude, draw: Callable[[Attitude], str]) -> None:
    text = draw(attitude)
    root = ElementTree.fromstring(text)  # noqa: S314 our own text
    assert root.tag == f"{SVG}svg"
    assert not re.search(r"href|url\(|nan[ ,\"]", text)
    _, _, width, height = (float(v) for v in root.attrib["viewBox"].split())
    for shape in [*root.iterfind(f"{SVG}polygon"), *root.iterfind(f"{SVG}polyline")]:
        for x, y in (pair.split(",") for pair in shape.attrib["points"].split()):
            assert 0 <= float(x) <= width
            assert 0 <= float(y) <= height
    assert len(text) < 60_000


def words(attitude: Attitude) -> list[str]:
    root = ElementTree.fromstring(page(attitude))  # noqa: S314 our own text
    return [str(e.text) for e in root.iter(f"{SVG}text")]


def test_a_drawing_describes_itself_in_words() -> None:
    shown = words(Attitude(45, 90, 30, 1))
    assert shown[0] == "alpha 45 deg, beta 90 deg, sensor face down, turned by 30 deg on the table"
    assert {"Alpha 45°, from the front", "Beta 90°, sensor turned by 30°", "gravity", "x", "y", "z"} <= set(shown)
    assert minus(f"{np.sin(np.pi / 4) * np.cos(np.radians(120)):+.3f} g") in shown


def test_words_in_a_drawing_are_escaped() -> None:
    assert ElementTree.fromstring(svg.text((0, 0), "a <b> & c")).text == "a <b> & c"  # noqa: S314 our own text


def test_another_attitude_is_another_drawing() -> None:
    assert len({page(a) for a in EVERYWHERE}) == len(EVERYWHERE)
    assert len({"".join(sketch(Attitude(0, 0, mount, flip))) for mount in (0, 30, 90, 180) for flip in (0, 1)}) == 8


def test_only_visible_faces_are_drawn() -> None:
    camera = Camera(CAMERA_FROM, 100, (0, 0))
    assert len(list(box((0, 0, 0), (1, 1, 1), np.eye(3), "#888888").drawn(camera))) == 3
    faces = list(cylinder(1, 0, 1, 2, np.eye(3), "#888888").drawn(camera))
    assert len(faces) == 1 + 24  # its top, and half of those around


def test_a_sketch_shows_pin_1_and_both_axes_where_they_are() -> None:
    lines = sketch(Attitude())
    column = {name: next(line.index(name) for line in lines if name in line) for name in "oxy"}
    row = {name: next(k for k, line in enumerate(lines) if name in line) for name in "oxy"}
    assert column["x"] > column["y"] > column["o"]
    assert row["y"] < row["o"] < row["x"]
    assert len({len(line) for line in lines}) == 1
    flipped = sketch(Attitude(flip=1))
    assert next(k for k, line in enumerate(flipped) if "y" in line) > row["x"]


def test_questions_have_their_drawings() -> None:
    assert drawing_of(Mounting.of(90.0, 1)) == Attitude(mount_deg=90.0, flip=1)
    assert drawing_of(Confirm("m", "Up?", "face-up")) == Attitude()
    assert drawing_of(Confirm("m", "Off?")) is None


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.py")), ids=lambda path: path.stem)
def test_every_drawing_that_a_procedure_names_is_there(path: Path) -> None:
    assert set(re.findall(r'drawing="([^"]+)"', path.read_text(encoding="utf-8"))) <= set(NAMED)


def test_the_command_writes_the_file_and_prints_the_specific_force(rig: Rig, tmp_path: Path) -> None:
    out = tmp_path / "there.svg"
    ended = rig("draw", "--alpha", "45", "--beta", "90", "--mount", "0", "--flip", "0", "--out", str(out))
    assert ended.status == 0
    assert out.read_text() == page(Attitude(45, 90))
    assert "in g: x +0.0000, y +0.7071, z +0.7071" in ended.out
    document = rig("draw", "--alpha", "90", "--flip", "1", "--json").document
    assert document["specific_force_g"] == {"x": 1.0, "y": 0.0, "z": 0.0}
    assert "o: pin 1" in rig("draw").out


def test_the_drawing_in_the_readme_is_todays() -> None:
    shown = Path(__file__).parents[2] / "docs" / "attitude.svg"
    assert shown.read_text() == page(Attitude(45, 90)), "rig draw --alpha 45 --beta 90 --out docs/attitude.svg"


def test_an_impossible_drawing_is_refused(rig: Rig, tmp_path: Path) -> None:
    assert "nan is not an angle" in rig("draw", "--alpha", "nan").err
    for name in ("a.pdf", "a"):
        ended = rig("draw", "--out", str(tmp_path / name))
        assert (ended.status, ended.out) == (2, "")
        assert "a drawing is an SVG file; name it a.svg" in ended.err
        assert not (tmp_path / name).exists()
    ended = rig("draw", "--out", str(tmp_path / "no" / "such.svg"))
    assert (ended.status, ended.out) == (2, "")
    assert "give another file" in ended.err
