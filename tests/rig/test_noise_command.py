"""rig noise: of arrays, tables and runs; its document, its words, its pictures; and what it refuses."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from calibrations.noise.deviations import deviations
from drivers.recorder import Samples
from procedures.noise_floor import STILL
from procedures.session import Pose
from rig.record import KeptPose, Record
from rig.services.still import axes, coarse
from tests import recorded
from tests.rig.conftest import Rig

PROCESSES = {
    "white-noise", "flicker-noise", "rate-random-walk", "quantisation-noise", "sinusoidal-noise", "gauss-markov-noise",
}  # fmt: skip


def samples(n: int = 6000) -> np.ndarray:
    """White noise of 0.1 at 50 Hz: 0.0141 per root hertz."""
    return 2.5 + 0.1 * np.random.default_rng(1).standard_normal(n)


def table(path: Path, t_s: np.ndarray, constants: str = "", **columns: np.ndarray) -> str:
    names = ["t_s", *columns]
    rows = zip(t_s.tolist(), *[c.tolist() for c in columns.values()], strict=True)
    lines = [constants + ",".join(names), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines))
    return str(path)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    np.save("still.npy", samples())
    return tmp_path


@pytest.mark.parametrize("kind", ["f8", "f4", "i4"])
def test_the_document_of_an_array(rig: Rig, folder: Path, kind: str) -> None:
    np.save("some.npy", (samples() * 1000).astype(kind))
    said = rig("noise", "some.npy", "--rate", "50", "--json").done().document
    assert {"schema", "rate_hz", "n", "allan", "coefficients"} <= set(said)
    assert (said["schema"], said["rate_hz"], said["n"]) == ("rig.noise/1", 50.0, 6000)
    assert set(said["allan"]) == {"tau_s", "deviation", "low", "high"}
    assert said["allan"]["tau_s"][:2] == [0.02, 0.04]
    assert said["allan"]["deviation"][0] == pytest.approx(100, rel=0.03)
    assert said["allan"]["low"][0] < said["allan"]["deviation"][0] < said["allan"]["high"][0]
    assert set(said["coefficients"]) == PROCESSES
    white = said["coefficients"]["white-noise"]
    assert white["value"] == pytest.approx(100 / np.sqrt(50), abs=3 * white["std"])
    assert (white["unit"], white["identified"]) == ("count/sqrt(Hz)", True)
    for name in PROCESSES - {"white-noise"}:
        assert not said["coefficients"][name]["identified"]
        assert said["coefficients"][name]["upper"] > 0


def test_other_deviations_and_the_spectrum_have_intervals(rig: Rig, folder: Path) -> None:
    said = rig("noise", "still.npy", "--rate", "50", "--json").done().document
    assert set(said["deviations"]) == {"modified", "hadamard", "total"}
    for curve in said["deviations"].values():
        assert set(curve) == {"tau_s", "deviation", "low", "high"}
        held = [
            low < 0.1 / np.sqrt(50 * tau) < high
            for tau, low, high in zip(*[curve[k] for k in ("tau_s", "low", "high")], strict=True)
        ]
        assert held.count(False) <= (len(held) if curve is said["deviations"]["modified"] else 1)
        assert all(
            low < value < high
            for low, value, high in zip(*[curve[k] for k in ("low", "deviation", "high")], strict=True)
        )
    spectrum = {name: np.array(values) for name, values in said["spectrum"].items() if name != "unit"}
    assert said["spectrum"]["unit"] == "(count)^2/Hz"
    assert np.all(np.diff(spectrum["frequency_hz"]) > 0)
    true = 0.1**2 / 50
    assert np.mean((spectrum["low"] < true) & (true < spectrum["high"])) == pytest.approx(0.95, abs=0.04)
    assert spectrum["model"] == pytest.approx(true, rel=0.05)


@pytest.mark.parametrize(
    ("name", "kind", "says", "spoils"),
    [
        ("step", "step", "a step of +0.0", "rate-random-walk"),
        ("drift", "drift", "a drift of x by +", "rate-random-walk"),
        ("louder", "level", "the level of x changes with time", "white-noise"),
        ("wild", "wild-samples", "of x, one sample is far from the neighbours", "white-noise"),
        ("stuck", "constant-stretch", "of x, 300 samples from t = 40 s on are equal", "white-noise"),
        ("warm", "follows", "x follows temperature_c by +0.1", "rate-random-walk"),
    ],
)
def test_a_signal_that_is_no_noise_is_named_with_the_coefficients_that_it_spoils(
    rig: Rig, folder: Path, name: str, kind: str, says: str, spoils: str
) -> None:
    k = np.arange(6000)
    warm = 22 + 0.5 * np.sin(k / 700) + 0.3 * np.sin(k / 230)
    x = samples() + {
        "step": 0.05 * (k > 2500), "drift": 0.1 * k / 6000, "louder": (k > 4500) * 0.6 * (samples() - 2.5),
        "wild": 7.0 * (k == 1000), "stuck": 0 * k, "warm": 0.12 * warm,
    }[name]  # fmt: skip
    if name == "stuck":
        x[2000:2300] = x[2000]
    file = table(folder / "odd.csv", k / 50, vx_v=x, temperature_c=np.round(warm, 3))
    said = rig("noise", file, "--json").done().document
    found = next(each for each in said["disturbances"] if each["kind"] == kind)
    assert says in found["text"]
    assert spoils in found["spoils"]
    shown = rig("noise", file).out
    removed = kind in ("step", "drift", "follows")
    assert f"{found['text']}{', removed' if removed else ';'}" in shown
    assert ("the fit would give" in shown) == removed
    assert said["coefficients_without"] == (said["coefficients"] if removed else None)
    assert said["coefficients"]["white-noise"]["identified"]
    if removed:
        assert f"  x: {spoils}" in shown
        assert not said["coefficients"][spoils]["identified"]


def test_a_clean_record_has_no_disturbance(rig: Rig, folder: Path) -> None:
    said = rig("noise", "still.npy", "--rate", "50", "--json").done().document
    assert (said["disturbances"], said["coefficients_without"]) == ([], None)
    assert "not noise" not in rig("noise", "still.npy", "--rate", "50").out


def test_a_table_with_its_rate_in_its_times(rig: Rig, folder: Path) -> None:
    file = table(folder / "still.csv", np.arange(6000) / 50, vx_v=samples(), vy_v=2 * samples())
    ended = rig("noise", file, "--channel", "vy", "--json")
    assert ended.done().document["coefficients"]["white-noise"]["value"] == pytest.approx(0.2 / np.sqrt(50), rel=0.05)
    assert ended.done().document["rate_hz"] == pytest.approx(50)
    assert "still.csv: vy_v; --channel takes another: vx_v." in ended.err
    assert '"vq"' in rig("noise", file, "--channel", "vq").err


def test_the_noise_command_prints_a_text_and_saves_pictures(rig: Rig, folder: Path) -> None:
    ended = rig("noise", "still.npy", "--rate", "50", "--pictures", "pictures", "--format", "svg")
    assert ended.status == 0, ended.err
    assert "still.npy: 6000 samples at 50 Hz, 2:00" in ended.out
    assert "0.0141" in ended.out
    assert "not identified" in ended.out
    assert "Allan deviation (count)  95 % interval" in ended.out
    assert {path.name for path in (folder / "pictures").iterdir()} == {"allan.svg", "spectrum.svg"}
    for path in (folder / "pictures").iterdir():
        assert "white-noise" in path.read_text()
        assert "mathdefault" not in path.read_text()


@pytest.fixture
def run(rig_home: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The shared noise-floor run of 60 s."""
    shutil.copytree(recorded.record(tmp_path_factory, "noise-floor"), rig_home)
    with Record() as record:
        return record.runs()[0].run


def test_a_run_straight_from_its_record(rig: Rig, run: str) -> None:
    ended = rig("noise", run)
    assert ended.status == 0, ended.err
    assert f"{run}: 60000 samples at 1000 Hz, 1:00" in ended.out
    assert "uV/sqrt(Hz)" in ended.out
    assert "ug/sqrt(Hz)" in ended.out
    assert "15.07 Hz low-pass" in ended.err
    assert "supply_v was read in steps of 0.316 mV" in ended.err
    white = rig("noise", run, "--json").done().document["coefficients"]["white-noise"]
    assert white["unit"] == "V/sqrt(Hz)"
    assert white["value"] == pytest.approx(1.1e-4, rel=0.15)  # 3.1 mV peak to peak is 4 rms behind 15.07 Hz (Ang V)


def test_no_block_of_a_run_is_read_twice(run: str) -> None:
    with Record() as record:
        (still,) = axes(record, run, "vy", None).values()
        lengths = [len(block) for block in still.blocks]
    assert lengths == [10_000] * 6
    assert {name: sum(map(len, blocks)) for name, blocks in still.logged.items()} == dict.fromkeys(
        ("temperature_c", "supply_v"), 60_000
    )
    assert {len(block) for block in still.logged["supply_v"]} == {1000}
    assert still.scale_per_g == pytest.approx(1.0, rel=0.05)
    assert still.closed == []


@pytest.mark.parametrize(("noise_v", "told"), [(0.05e-3, True), (0.5e-3, False)])
def test_a_supply_is_coarse_where_noise_does_not_smooth_its_steps(noise_v: float, told: bool) -> None:
    step = 0.3e-3
    volts = np.round((5.0 + noise_v * np.random.default_rng(1).standard_normal((10_000, 1))) / step + 0.4) * step
    found = coarse(KeptPose(Pose(0, 0, 0, STILL), Samples(volts, ("supply",), 1000.0, 0.0), 0.0, 22.0))
    assert found == ({"supply_v": pytest.approx(step)} if told else {})


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("still.npy",), "does not contain the sample rate; give --rate HZ"),
        (("nowhere.npy", "--rate", "5"), "nowhere.npy: there is no such file"),
        (("square.npy", "--rate", "5"), "has an array of shape (8, 8); save one channel"),
        (("broken.npy", "--rate", "5"), "broken.npy: is not an array from numpy.save"),
        (("hole.npy", "--rate", "5"), "sample 4001 is nan, not a number"),
        (("short.npy", "--rate", "5"), "needs 64 or more"),
        (("still.npy", "--rate", "0"), "0 is not in the range"),
        (("still.npy", "--rate", "50", "--tau", "100"), "an averaging time of 100 s needs a record of 200 s or more"),
        (("still.npy", "--rate", "50", "--tau", "0.001"), "is shorter than one sample, 0.02 s"),
        (("rate.csv",), "the stated rate is 100 samples a second, the column t_s gives 50"),
        (("uneven.csv",), "s; samples must be evenly spaced: record again with evenly spaced samples"),
        (("means.csv",), "a row is the mean of 500 samples (column n), as in poses"),
        (("one-constant.csv",), "channel vx_v (--channel takes another: vy_v): every sample is the same"),
        (("torn.csv",), "1 gaps, 200 s in total, and 119.98 s of samples; the longest, of 200 s, is at t = 19.98 s"),
        (("back.csv",), "row 501: the time does not increase"),
        (("constant.csv",), "every sample is the same"),
        (("poses.csv",), "a table of poses; a noise analysis needs single samples"),
    ],
)
def test_bad_input_of_the_noise_command_is_one_message(
    rig: Rig, folder: Path, words: tuple[str, ...], says: str
) -> None:
    t_s = np.arange(6000) / 50
    hole = samples()
    hole[4000] = np.nan
    for name, values in {"square": np.ones((8, 8)), "hole": hole, "short": samples(9)}.items():
        np.save(f"{name}.npy", values)
    Path("broken.npy").write_bytes(b"no array at all")
    torn, back = t_s.copy(), t_s.copy()
    late = np.cumsum(np.random.default_rng(1).exponential(0.02, 6000))
    torn[1000:] += 200
    back[500] = 0.0
    table(folder / "rate.csv", t_s, "# sample_rate_hz: 100\n", vx_v=samples())
    for name, times in {"uneven": late, "torn": torn, "back": back}.items():
        table(folder / f"{name}.csv", times, vx_v=samples())
    table(folder / "means.csv", t_s, vx_v=samples(), n=np.full(6000, 500.0))
    table(folder / "one-constant.csv", t_s, vx_v=np.full(6000, 2.5), vy_v=samples())
    table(folder / "constant.csv", t_s, vx_v=np.full(6000, 2.5))
    Path("poses.csv").write_text("alpha_deg,beta_deg,vx_v\n90,0,3.5\n90,180,1.5\n")
    ended = rig("noise", *words)
    assert (ended.status, ended.out) == (2, "")
    assert says in ended.err
    assert len(ended.err.strip().splitlines()) <= (4 if "Usage" in ended.err else 1)


def test_samples_are_joined_across_short_gaps_with_a_remark(rig: Rig, folder: Path) -> None:
    t_s = np.arange(6000) / 50
    t_s[2000:] += 1.0
    ended = rig("noise", table(folder / "gap.csv", t_s, vx_v=samples()), "--json")
    assert ended.done().document["rate_hz"] == pytest.approx(50)
    assert "across a gap, 1 s in total" in ended.err


def test_times_of_a_computer_that_samples_reach_in_bursts(rig: Rig, folder: Path) -> None:
    """As real logs have them: five samples at once, then none for as long as these took."""
    t_s = np.floor(np.arange(6000) / 5) * 0.1 + 0.001 * (np.arange(6000) % 5)
    file = table(folder / "bursts.csv", t_s, vx_v=samples())
    ended = rig("noise", file, "--json")
    assert ended.done().document["rate_hz"] == pytest.approx(50, rel=5e-3)
    assert "Times are uneven" in ended.err


def test_deviations_are_given_at_the_requested_times(rig: Rig, folder: Path) -> None:
    said = rig("noise", "still.npy", "--rate", "50", "--tau", "0.1", "--tau", "3", "--json").done().document["allan"]
    assert said["tau_s"] == [0.1, 3.0]
    assert said["deviation"] == pytest.approx(deviations(samples(), (5, 150)).tolist())
    assert said["low"][1] < 0.1 / np.sqrt(150) < said["high"][1]
    octaves = rig("noise", "still.npy", "--rate", "50", "--json").done().document["allan"]
    again = rig("noise", "still.npy", "--rate", "50", "--tau", "0.16", "--json").done().document["allan"]
    for name in ("deviation", "low", "high"):
        assert again[name][0] == pytest.approx(octaves[name][3])


def test_an_averaging_time_that_is_no_whole_number_of_samples_gets_a_remark(rig: Rig, folder: Path) -> None:
    ended = rig("noise", "still.npy", "--rate", "50", "--tau", "0.05", "--tau", "0.1")
    assert ended.status == 0
    assert "An averaging time of 0.05 s is not a whole number of samples: 0.04 s is used." in ended.err
    assert "of 0.1 s" not in ended.err


def test_noise_below_the_converters_step_and_of_two_levels_is_said_first(rig: Rig, folder: Path) -> None:
    random = np.random.default_rng(4)
    np.save("coarse.npy", np.round(2.6 + 0.15 * random.standard_normal(6000)))
    trap = np.where(np.cumsum(random.random(6000) < 0.01) % 2, 0.0, 0.4)
    np.save("trap.npy", samples() + trap)
    coarse = rig("noise", "coarse.npy", "--rate", "50")
    assert "Of x, the noise is below the converter's step: the samples have 2 values in steps of 1" in coarse.out
    assert "flicker-noise       not known" in coarse.out
    assert "not noise:" not in coarse.out
    assert "cannot separate" not in coarse.err
    said = rig("noise", "trap.npy", "--rate", "50", "--json").done().document
    assert [each["kind"] for each in said["disturbances"]] == ["two-levels"]
    shown = rig("noise", "trap.npy", "--rate", "50").out
    assert "Random telegraph noise (burst noise, popcorn): x jumps between two levels 0.4" in shown
    assert "not noise:" not in shown
    assert "averaging for longer does not help" not in rig("noise", "still.npy", "--rate", "50").out


def test_single_samples_that_were_lost_are_no_jitter(rig: Rig, folder: Path) -> None:
    kept = np.random.default_rng(2).random(6000) > 0.03
    kept[[0, 1]] = True
    kept[3000:3500] = True
    file = table(folder / "lost.csv", (np.arange(6000) / 50)[kept], vx_v=samples()[kept])
    ended = rig("noise", file)
    assert ended.status == 2
    assert f"{np.sum(~kept[: np.flatnonzero(kept)[-1]])} single samples are missing" in ended.err
    lost = np.flatnonzero(~kept)
    first = 3000 - np.count_nonzero(~kept[:3000]) - (2999 - lost[lost < 3000][-1])
    assert f"or analyse rows {first + 1} to {first + lost[lost >= 3500][0] - lost[lost < 3000][-1] - 1}, " in ended.err
