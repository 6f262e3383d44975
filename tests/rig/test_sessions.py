"""Sessions of others by commands alone: six faces and three turns by hand, and devices that write JSON."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibrations.errors import DataError
from calibrations.files import text_source
from calibrations.importing.other_texts import as_lines
from tests.calibrations.turned import DATA
from tests.foreign_files import read_foreign
from tests.rig.conftest import Rig

NAMES = [f"{ours}{axis}={theirs}_{axis}" for ours, theirs in (("a", "acc"), ("g", "gyr")) for axis in "xyz"]
SESSION = ("--kind", "rates", *(word for name in ["path=part", *NAMES] for word in ("--column", name)))
RATE, TURN = ("--constant", "sample_rate_hz=204.8"), ("--constant", "turn_deg=360")


@pytest.mark.slow
def test_six_faces_and_three_turns_give_the_published_calibration(rig: Rig, tmp_path: Path) -> None:
    file = str(DATA / "imucal_ferraris_gyro" / "annotated_session.csv.gz")
    taken = rig("import", file, *SESSION, *RATE, *TURN, "--json")
    assert "the means of 9 rests and turns, from 9414 samples" in taken.err
    run, models = taken.document["run"], [str(tmp_path / name) for name in ("leaning.yaml", "whole.yaml")]
    assert rig("diagnose", run, "--json").document["candidates"][0]["effect"] == "gyro-misalignment"
    assert rig("add", "gyro-misalignment", "--model", "gyroscope", "--data", run, "--out", models[0]).status == 0
    rig("add", "gyro-g-sensitivity", "--model", models[0], "--data", run, "--out", models[1])
    found = rig("fit", run, "--model", models[1], "--json").document
    values = {f"{p['effect']} {p['axis']}": p["value"] for p in found["parameters"]}
    assert [values[f"gyro-scale-factor {a}"] for a in "xyz"] == pytest.approx([16.6777, 16.1879, 16.2534], abs=2e-4)
    assert [values[f"gyro-bias {a}"] for a in "xyz"] == pytest.approx([1.96, -4.47, -3.65], abs=0.02)
    assert found["accelerometer"]["bias"] == pytest.approx([-6.01887, -48.28787, -28.96637], abs=5e-6)
    assert "from its six faces: bias -6.018868, -48.28787, -28.96637" in rig("fit", run, "--model", models[0]).out
    page = tmp_path / "page.html"
    assert rig("report", run, "--model", models[0], "--out", str(page)).status == 0
    assert "fails" in rig("compare", run, "--model", models[0], "--json").document


def test_missing_facts_of_a_log_are_requested(rig: Rig) -> None:
    file = str(DATA / "imucal_ferraris_gyro" / "annotated_session.csv.gz")
    refused = rig("import", file, *SESSION, *RATE)
    assert refused.status == 2
    assert "such as --constant turn_deg=360" in refused.err
    refused = rig("import", file, *SESSION, *TURN)
    assert refused.status == 2
    assert "needs the column t_s, or the constant sample_rate_hz" in refused.err


def test_a_section_of_a_log_is_a_turn_if_the_gyroscope_shows_a_turn(tmp_path: Path) -> None:
    """A turn back, by times of its own, and an unsteady hand: its mean is the angle over its time."""
    random, lines = np.random.default_rng(1), ["t_s,path,gx,gy,gz"]
    t = 0.0
    for name, rate, n in (("rest", 0.0, 200), ("round", 60.0, 300), ("rest again", 0.0, 200)):
        hand = rate * (1 + 0.5 * np.sin(np.linspace(0, 20 * np.pi, n, endpoint=False)))
        for value in hand:
            lines.append(
                f"{t:.3f},{name},{random.normal():.3f},{random.normal():.3f},{16 * value + random.normal():.3f}"
            )
            t += 0.02
    file = tmp_path / "session.csv"
    file.write_text("\n".join(lines))
    table = read_foreign(file, "rates", constants={"turn_deg": 360.0})
    assert np.unique(table.column("rate_deg_s")).tolist() == pytest.approx([0.0, 60.0])
    assert np.count_nonzero(table.column("rate_deg_s")) == 300


@pytest.mark.parametrize(("device", "left"), [("HC", 0.76), ("JG", 1.01)])
def test_a_device_that_writes_json_is_calibrated(rig: Rig, tmp_path: Path, device: str, left: float) -> None:
    names = [word for axis in "xyz" for word in ("--column", f"m{axis}=mag_{axis}:uT")]
    file, out = str(DATA / "sap6_mag_acc" / f"{device}.json"), str(tmp_path / "found.yaml")
    taken = rig("import", file, "--kind", "positions", *names, "--json").document
    assert taken["rows"] == 24
    assert rig("discover", taken["run"], "--out", out, "--json").document["causes"] == ["hard-iron", "soft-iron"]
    found = rig("fit", taken["run"], "--model", out, "--json").document
    assert 1e3 * found["rmse"]["norm"] == pytest.approx(left, abs=0.006)


def read(content: str) -> str:
    with as_lines(text_source(content, "some.json")).lines() as lines:
        return "".join(lines)


def test_json_is_arrays_or_rows_and_the_rest_is_constants() -> None:
    rows = '[{"mx": 1, "my": 2}, {"mx": 3, "my": 4}]'
    assert read(rows) == "mx,my\n1,2\n3,4\n"
    arrays = '{"unit": "uT", "mag": [[1, 2, 3], [4, 5, 6]], "pair": [[7, 8], [9, 0]], "t_s": [0.5, 1.5]}'
    assert read(arrays) == "# unit: uT\nmag_x,mag_y,mag_z,pair_1,pair_2,t_s\n1,2,3,7,8,0.5\n4,5,6,9,0,1.5\n"
    assert read("a,b\n1,2\n") == "a,b\n1,2\n"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ('{"mag": [[1, 2, 3]', "is not valid JSON; give arrays"),
        ('{"a": [1, 2], "b": [1]}', "arrays of different length: {'a': 2, 'b': 1}"),
        ('{"mag": [[1, 2, 3], [1, 2]]}', 'row 2 of "mag" does not have 3 numbers'),
        ('{"name": "x"}', "has no arrays of measurements"),
        ("[1, 2]", "has no arrays of measurements"),
    ],
)
def test_json_that_is_no_table_is_refused(content: str, said: str) -> None:
    with pytest.raises(DataError) as refused:
        read(content)
    assert said in str(refused.value)
