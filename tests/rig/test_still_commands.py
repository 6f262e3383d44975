"""The analysis commands on still records: tables, arrays and runs; documents, words, pictures; and what they refuse."""

from __future__ import annotations

import html
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from calibrations.table import Array
from tests import recorded
from tests.calibrations.hidden_noise import RATE_HZ, fractional, traps, white
from tests.calibrations.ramps import record
from tests.rig.conftest import Rig

N = 6000
COMMANDS = ("compare", "fit", "diagnose", "discover", "report", "add")


def words_of(command: str, data: str) -> tuple[str, ...]:
    """A call of a command on data."""
    if command == "add":
        return ("add", "flicker-noise", "--model", "still", "--data", data, "--out", "made.yaml")
    return (command, data, *(("--out", "page.html") if command == "report" else ()))


def write(path: str, t_s: Array, constants: str = "", **columns: Array) -> None:
    rows = zip(t_s.tolist(), *[c.tolist() for c in columns.values()], strict=True)
    lines = [constants + ",".join(["t_s", *columns]), *(",".join(map(repr, row)) for row in rows)]
    Path(path).write_text("\n".join(lines))


@pytest.fixture(scope="module")
def samples() -> tuple[Array, Array]:
    """White noise of 1 mV, x with flicker beside."""
    random = np.random.default_rng(4)
    x = white(random, N) + 0.7 * traps(random, N)
    return 2.5 + 1e-3 * x, 2.5 + 1e-3 * white(random, N)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, samples: tuple[Array, Array]) -> Path:
    monkeypatch.chdir(tmp_path)
    x, y = samples
    write("still.csv", np.arange(N) / RATE_HZ, "# sensor: ADXL203\n", vx_v=x, vy_v=y)
    np.save("x.npy", x)
    return tmp_path


def test_a_missing_effect_is_found_and_added(rig: Rig, folder: Path) -> None:
    said = rig("diagnose", "still.csv", "--json").done().document
    assert said["schema"] == "rig.diagnosis/1"
    assert (said["verdict"], said["candidates"][0]["effect"]) == ("effect-missing", "flicker-noise")
    best = said["candidates"][0]
    assert best["p_value"] < 0.003
    assert best["held_out_after"] < best["held_out_before"]
    assert best["axes"] == ["x", "y"]

    added = rig(*words_of("add", "still.csv"), "--json").done().document
    assert (added["schema"], added["verdict"], added["causes"]) == ("rig.discovery/1", "adequate", ["flicker-noise"])
    step = added["steps"][0]
    assert step["log_likelihood_after"] > step["log_likelihood_before"] + 100
    assert step["allan_mismatch_after"]["x"] < step["allan_mismatch_before"]["x"] / 3
    assert step["excess_after"] == pytest.approx(1, abs=0.15)
    assert step["excess_before"] > 2

    again = rig("diagnose", "still.csv", "--model", "made.yaml", "--json", "--check").done().document
    assert again["verdict"] == "adequate"
    kept = yaml.safe_load(Path("made.yaml").read_text())
    assert (kept["unit"], kept["provenance"]["sensor"]) == ("V", "ADXL203")
    assert {p["axis"] for entry in kept["effects"] for p in entry["parameters"]} == {"x", "y"}


def test_compare_sets_both_curves_side_by_side(rig: Rig, folder: Path) -> None:
    said = rig("compare", "still.csv", "--json").done().document
    assert said["schema"] == "rig.comparison/1"
    for axis in "xy":
        assert said["excess"][axis] == pytest.approx(said["rmse"][axis] / said["noise_floor"][axis])
    curve = said["allan"]["x"]
    assert len(curve["tau_s"]) == len(curve["model"]) == len(curve["deviation"]) > 8
    worst = next(place for place in said["fails"] if place["where"] == "averaging time" and place["excess"] > 3)
    assert (worst["axis"], worst["from"] > RATE_HZ**-1) == ("x", True)
    assert all(place["axis"] == "x" for place in said["fails"])
    assert rig("compare", "still.csv", "--check").status == 1
    assert rig("discover", "still.csv", "--out", "found.yaml").status == 0
    shown = rig("compare", "still.csv", "--model", "found.yaml", "--check")
    assert shown.status == 0, shown.out
    assert "fails nowhere" in shown.out


def test_an_array_is_analysed_with_a_stated_rate(rig: Rig, folder: Path) -> None:
    said = rig("fit", "x.npy", "--rate", "10", "--model", "still", "--json").done().document
    assert said["parameters"][0]["unit"] == "count/sqrt(Hz)"
    ended = rig("discover", "x.npy", "--rate", "10", "--all")
    assert "+ flicker-noise" in ended.out
    assert "misses flicker-noise." in ended.out
    assert "give --rate HZ" in rig("discover", "x.npy").err


def test_one_channel_can_be_chosen(rig: Rig, folder: Path) -> None:
    assert rig("diagnose", "still.csv", "--channel", "vy", "--json").done().document["verdict"] == "adequate"
    only = rig("fit", "still.csv", "--channel", "vy", "--out", "y.yaml", "--json").done().document
    assert {p["axis"] for p in only["parameters"]} == {"y"}
    ended = rig("compare", "still.csv", "--model", "y.yaml")
    assert (ended.status, "has values for the axes y, and none for x" in ended.err) == (2, True)
    assert 'has no channel "vq"' in rig("compare", "still.csv", "--channel", "vq").err


def test_the_report_is_one_page_with_both_pictures(rig: Rig, folder: Path) -> None:
    ended = rig("report", "still.csv", "--out", "page.html", "--pictures", "pictures", "--format", "svg")
    assert ended.status == 0, ended.err
    page = Path("page.html").read_text()
    assert 'The model "still" misses flicker-noise.' in html.unescape(page)
    assert "Allan deviation and model" in page
    assert "src=" not in page
    cells = [re.sub(r"<[^>]*>|\s+", " ", row).split() for row in re.findall(r"<tr>(.*?)</tr>", page, re.DOTALL)]
    table = {row[0]: " ".join(row[1:]) for row in cells if row and row[0] in ("N", "B", "K", "Q")}
    assert set(table) == {"N", "B", "K", "Q"}
    assert table["K"].startswith("rate-random-walk not identified, below")
    assert re.match(r"white-noise [\d.]+\(\d+\) µV/√Hz", table["N"])
    assert "Noise density as in data sheets" in page
    assert {path.name for path in Path("pictures").iterdir()} == {"allan.svg", "spectrum.svg"}


def test_a_run_straight_from_its_record(rig: Rig, rig_home: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    shutil.copytree(recorded.record(tmp_path_factory, "noise-floor"), rig_home)
    run = rig("runs", "--json").done().document["runs"][0]["run"]
    said = rig("diagnose", run, "--json").done().document
    assert (said["data"], said["verdict"]) == (run, "adequate")
    fit = rig("fit", run, "--json").done().document
    density = {p["axis"]: p["value"] for p in fit["parameters"]}
    assert density == pytest.approx(dict.fromkeys("xy", 1.126e-4), rel=0.1)  # 0.775 mV behind 15.07 Hz (Ang V)


@pytest.mark.slow
def test_flicker_and_hum_of_the_simulated_world_are_found_through_its_sockets(
    rig: Rig, folder: Path, monkeypatch: pytest.MonkeyPatch, bench_file: Callable[..., Path]
) -> None:
    """Traps in x and mains in the leads of y; the world knows no spectrum."""
    monkeypatch.setenv("RIG_HOME", str(folder / "home"))
    noise = {"x": {"flicker_v": 100e-6}, "y": {"hum_v": 200e-6}}
    bench = str(bench_file({"world": {"preset": "ideal", "noise": noise}}))
    run = (
        rig("run", "noise-floor", "--duration-s", "300", "--bench", bench, "--unattended", "--json")
        .done()
        .document["run"]
    )
    said = rig("discover", run, "--out", "found.yaml", "--json").done().document
    assert set(said["causes"]) == {"flicker-noise", "sinusoidal-noise"}
    entries = yaml.safe_load(Path("found.yaml").read_text())["effects"]
    known = {(e["effect"], p["name"], p["axis"]): p for e in entries for p in e["parameters"]}
    flicker, hum = known["flicker-noise", "coefficient", "x"], known["sinusoidal-noise", "amplitude_1", "y"]
    assert flicker["value"] == pytest.approx(100e-6 * np.sqrt(np.pi / np.log(10)), abs=4 * flicker["std"])
    assert hum["value"] == pytest.approx(200e-6, rel=0.05)
    assert known["sinusoidal-noise", "frequency_1", "y"]["value"] == pytest.approx(50, abs=0.02)
    assert known["flicker-noise", "coefficient", "y"]["identified"] is False


def test_an_ambiguous_answer_comes_with_a_longer_record(rig: Rig, folder: Path) -> None:
    random = np.random.default_rng(0)
    np.save("short.npy", white(random, N) + 0.003 * np.cumsum(random.standard_normal(N)))
    said = rig("diagnose", "short.npy", "--rate", "10", "--json").done().document
    assert said["verdict"] == "ambiguous"
    assert said["candidates"][0]["indistinguishable_from"]
    following = said["next_experiment"]
    assert (following["procedure"], following["settings"]["duration_s"] > N / 10) == ("noise-floor", True)
    assert following["command"].startswith("rig run noise-floor --duration-s ")
    assert 0 < following["expected"]["probability"] <= 1


def bad(folder: Path) -> None:
    """One file of each kind that cannot be taken."""
    x, t_s = 2.5 + 1e-3 * white(np.random.default_rng(2), N), np.arange(N) / RATE_HZ
    torn, late, nan = t_s.copy(), np.cumsum(np.random.default_rng(1).exponential(0.1, N)), x.copy()
    torn[1000:] += 600
    nan[4000] = np.nan
    write("nan.csv", t_s, vx_v=nan)
    write("gap.csv", torn, vx_v=x)
    write("late.csv", late, vx_v=x)
    write("rate.csv", t_s, "# sample_rate_hz: 100\n", vx_v=x)
    write("constant.csv", t_s, vx_v=np.full(N, 2.5))
    write("clipped.csv", t_s, vx_v=np.minimum(x, 2.5005))
    write("short.csv", t_s[:50], vx_v=x[:50])


@pytest.mark.parametrize("command", COMMANDS)
def test_bad_still_records_give_one_message(rig: Rig, folder: Path, command: str) -> None:
    bad(folder)
    before = set(folder.iterdir())
    for data, says in {
        "nan.csv": "nan",
        "gap.csv": "analyse the parts between the gaps separately",
        "late.csv": "samples must be evenly spaced: record again with evenly spaced samples",
        "rate.csv": "the stated rate is 100 samples a second, the column t_s gives 10; correct one",
        "constant.csv": "every sample is the same; check that the sensor is connected",
        "clipped.csv": "the channel is clipped; choose a wider range",
        "short.csv": "50 samples; the noise of a record needs 64 or more",
    }.items():
        ended = rig(*words_of(command, data))
        assert (ended.status, ended.out) == (2, ""), data
        assert says in ended.err, ended.err
        assert ended.err.startswith("rig: ")
    assert set(folder.iterdir()) == before


def test_samples_are_joined_across_a_small_gap_with_a_remark(
    rig: Rig, folder: Path, samples: tuple[Array, Array]
) -> None:
    t_s = np.arange(N) / RATE_HZ
    t_s[3000:] += 5
    write("gap.csv", t_s, vx_v=samples[0])
    ended = rig("diagnose", "gap.csv")
    assert ended.status == 0
    assert "across a gap, 5 s in total" in ended.err


@pytest.mark.slow
def test_known_noise_lets_a_quiet_model_be_adequate(rig: Rig, folder: Path) -> None:
    """A sweep under flicker five times the white noise of a mean, whose level a still record has told."""
    from calibrations.importing.foreign import write_csv
    from tests.calibrations.synthetic import components, poses, turns

    random, columns = np.random.default_rng(6), turns()
    x, y, _ = components(columns)
    slow = [2.5e-4 * fractional(random, len(x)) for _ in range(2)]
    write_csv(poses(columns, 2.5 + x + slow[0], 2.5 + y + slow[1]), "sweep.csv")
    still = [2.5 + 1e-3 * white(random, N) + 2.5e-4 * fractional(random, N) for _ in range(2)]
    write("rest.csv", np.arange(N) / RATE_HZ, vx_v=still[0], vy_v=still[1])
    assert rig("discover", "rest.csv", "--out", "noise.yaml").status == 0
    assert rig("diagnose", "sweep.csv", "--json").done().document["verdict"] == "unexplained"
    assert rig("diagnose", "sweep.csv", "--noise", "noise.yaml", "--json").done().document["verdict"] == "adequate"
    assert rig("compare", "sweep.csv", "--noise", "noise.yaml", "--check").status == 0


@pytest.mark.slow
def test_a_legend_has_each_name_once(rig: Rig, folder: Path) -> None:
    """Of a model that misses nothing, of one whose record had something taken off, and of a single process."""
    random = np.random.default_rng(3)
    np.save("white.npy", white(random, N))
    np.save("step.npy", white(random, N) + 2.0 * (np.arange(N) > 2000))
    shown = {}
    for name in ("white", "step"):
        for words in (("report", f"{name}.npy", "--out", f"{name}.html"), ("noise", f"{name}.npy")):
            made = f"{name}-{words[0]}"
            ended = rig(*words, "--rate", "10", "--pictures", made, "--format", "svg")
            assert ended.status == 0, ended.err
            for path in Path(made).iterdir():
                texts = re.findall(r"<text[^>]*>([^<]+)</text>", path.read_text())
                shown[made, path.stem] = [text for text in texts if re.fullmatch(r"[a-z][a-z ,-]+", text)]
    for legend in shown.values():
        assert len(set(legend)) == len(legend)
    assert "their sum" not in shown["white-noise", "allan"]
    assert "measured, after removing non-noise signals" in shown["step-report", "allan"]
    assert "measured, after removing non-noise signals" not in shown["white-report", "allan"]


@pytest.mark.slow
def test_a_ramp_at_rest_is_calibrated_in_less_than_ten_lines(rig: Rig, folder: Path) -> None:
    volts, warm = record(np.random.default_rng(5), line=5e-4, glue=4e-3)
    rows = np.column_stack([np.arange(len(volts)), volts, warm])
    np.savetxt(folder / "ramp.csv", rows, delimiter=",", header="t_s,vx_v,temperature_c", comments="", fmt="%.9g")
    ended = rig("discover", "ramp.csv", "--out", "ramp.yaml")
    assert len(ended.out.splitlines()) < 10
    assert "temperature-hysteresis" in ended.out
    assert "+ temperature-hysteresis" in rig("discover", "ramp.csv", "--all").out
    said = rig("compare", "ramp.csv", "--model", "ramp.yaml", "--json").done().document
    assert said["fails"] == []
    again = rig("discover", "ramp.csv", "--model", "ramp.yaml", "--json").done().document
    assert (again["verdict"], again["causes"]) == ("adequate", [])
    assert rig("report", "ramp.csv", "--model", "ramp.yaml", "--out", "ramp.html").status == 0


def test_each_sensor_of_a_still_record_has_its_own_unit(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a ROS bag has them: an accelerometer in m/s2, a gyroscope in rad/s, a magnetometer without a unit."""
    monkeypatch.chdir(tmp_path)
    random, names = np.random.default_rng(6), ["ax (m/s2)", "ay (m/s2)", "az (m/s2)"]
    names += ["gx (rad/s)", "gy (rad/s)", "gz (rad/s)", "mx", "my", "mz"]
    write("six.csv", np.arange(N) / RATE_HZ, **{name: white(random, N) for name in names})
    taken = rig("import", "six.csv", "--kind", "still", "--json").done().document
    for channel, unit, noise in (("ax", "m/s2", 1.0), ("gy", "deg/s", 180 / np.pi), ("mz", "count", 1.0)):
        found = rig("noise", taken["run"], "--channel", channel, "--json").done().document
        assert found["unit"] == unit
        assert found["allan"]["deviation"][0] == pytest.approx(noise, rel=0.1)


def test_the_summary_of_a_report_states_the_mismatch_once(rig: Rig, folder: Path) -> None:
    volts = 1e-4 * np.random.default_rng(5).standard_normal(20_000)
    write("white.csv", np.arange(len(volts)) / 100, vx_v=volts)
    assert rig("report", "white.csv", "--out", "white.html").status == 0
    lead = Path("white.html").read_text(encoding="utf-8").partition('<p class="lead">')[2].partition("</p>")[0]
    assert "Remaining error" in lead
    assert lead.count("times the scatter by chance") == 1
