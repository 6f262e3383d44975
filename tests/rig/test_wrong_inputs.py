"""Plausible but wrong tables, model files, bench files and settings: each ends in one message with its place.

The words of the messages are in tests/golden; here the exit status, the place and the absence of results count.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.rig.conftest import Rig

HEAD = "alpha_deg,beta_deg,vx_v"
GOOD = f"{HEAD}\n" + "".join(f"90,{45 * k},{2.5 + 0.1 * k:.1f}\n" for k in range(8))


def with_column(name: str, value: str) -> str:
    """The good table with one column more, the same in all rows."""
    head, *rows = GOOD.splitlines()
    return "\n".join([f"{head},{name}", *(f"{row},{value}" for row in rows), ""])


TABLES = {  # the text of the table, and the place that the message names
    "empty": ("", "empty"),
    "header alone": (f"{HEAD}\n", "no rows"),
    "binary": ("\0\1\2", "byte 0"),
    "words in all cells": (f"{HEAD}\na,b,c\n", "no numbers"),
    "short row": (f"{HEAD}\n90,0,2.5\n90,2.5\n", "line 3"),
    "long row": (f"{HEAD}\n90,0,2.5\n90,10,2.5,7\n", "line 3"),
    "not a number": (f"{HEAD}\n90,0,2.5\n90,45,nan\n", 'line 3, column "vx_v"'),
    "infinite": (f"{HEAD}\n90,0,2.5\n90,45,inf\n", 'line 3, column "vx_v"'),
    "a word in a cell": (f"{HEAD}\n90,0,2.5\n90,45,open\n", 'line 3, column "vx_v"'),
    "empty cell": (f"{HEAD}\n90,0,2.5\n90,,2.5\n", 'line 3, column "beta_deg"'),
    "one name twice": (f"{HEAD},vx_v\n90,0,2.5,2.5\n90,45,2.6,2.6\n", 'line 1: the column "vx_v"'),
    "no name": ("alpha_deg,,vx_v\n90,0,2.5\n", "line 1"),
    "no output": ("alpha_deg,beta_deg\n90,0\n90,45\n", '"vx_v"'),
    "one angle": ("alpha_deg,vx_v\n90,2.5\n0,2.6\n", '"beta_deg"'),
    "capitals": (GOOD.replace("vx_v", "VX_V"), '"vx_v"'),
    "radians": (f"{HEAD}\n" + "".join(f"1.5708,{0.7854 * k:.4f},{2.5 + k / 10}\n" for k in range(8)), '"alpha_deg"'),
    "millivolts": (f"{HEAD}\n" + "".join(f"90,{45 * k},{2500 + 100 * k}\n" for k in range(8)), '"vx_v"'),
    "kelvin": (with_column("temperature_c", "298.15"), '"temperature_c"'),
    "gravity in g": ("# gravity_m_s2: 1\n" + GOOD, '"gravity_m_s2"'),
    "gravity in cm/s^2": ("# gravity_m_s2: 980.665\n" + GOOD, '"gravity_m_s2"'),
    "gravity as a word": ("# gravity_m_s2: earth\n" + GOOD, '"gravity_m_s2"'),
    "no gravity": ("# gravity_m_s2: 0\n" + GOOD, '"gravity_m_s2"'),
    "negative corner": ("# filter_corner_hz: -15\n" + GOOD, '"filter_corner_hz"'),
    "corner as a word": ("# filter_corner_hz: low\n" + GOOD, '"filter_corner_hz"'),
    "no sample rate": ("# sample_rate_hz: 0\n" + GOOD, '"sample_rate_hz"'),
    "no samples in a mean": (with_column("n", "0"), 'column "n"'),
    "negative std": (with_column("vx_std_v", "-0.1"), 'column "vx_std_v"'),
    "unknown direction": (with_column("direction", "5"), 'column "direction"'),
    "one row": (f"{HEAD}\n90,0,2.5\n", "1 rows"),
}
MODELS = {
    "empty": "",
    "list": "- bias\n",
    "one word": "linear\n",
    "no schema": "name: m\n",
    "tab": "name:\tm\n\tx: 1\n",
    "misspelt effect": "effects: {biass: {}}\n",
    "nested lists": "effects: [[[1]]]\n",
}
REMEDIES = (  # words of what to do
    *(
        "give",
        "write",
        "correct",
        "remove",
        "export",
        "import",
        "rename",
        "name a column",
        "name every",
        "measure more",
    ),
    *(
        "must be",
        "must give",
        "should be",
        "Did you mean",
        "There are:",
        "Write",
        "prints",
        "save the sheet",
        "begins with",
    ),
    *("set another", "a header line with column names, and rows"),
)
STAGE = "driver: oriental_az, url: simulated"
ADC = "instruments: {adc: {driver: labjack_t7, url: simulated, settings: {channels: "
BENCHES = {  # the text of the bench file, and the key that the message names
    "empty": ("", "bench file"),
    "list": ("- alpha\n", "bench file"),
    "no driver": ("instruments: {alpha: {url: simulated}}", "instruments.alpha.driver"),
    "misspelt driver": ("instruments: {alpha: {driver: oriental, url: simulated}}", "instruments.alpha.driver"),
    "misspelt key": ("instrument: {}", "key instrument"),
    "no address": ("instruments: {alpha: {driver: oriental_az, url: usb 1}}", "instruments.alpha.url"),
    "unit below zero": (f"instruments: {{alpha: {{{STAGE}, unit: -1}}}}", "instruments.alpha.unit"),
    "unit above a byte": (f"instruments: {{alpha: {{{STAGE}, unit: 999}}}}", "instruments.alpha.unit"),
    "unit as a word": (f"instruments: {{alpha: {{{STAGE}, unit: one}}}}", "instruments.alpha.unit"),
    "one unit twice": (f"instruments: {{alpha: {{{STAGE}}}, beta: {{{STAGE}}}}}", "instruments.beta.unit"),
    "one input twice": (ADC + "{vx: 0, vy: 0}, rate_hz: 1000}}}", "settings.channels"),
    "negative rate": (ADC + "{vx: 0}, rate_hz: -5}}}", "instruments.adc.settings"),
    "misspelt setting": (
        "instruments: {oven: {driver: omega_cn7500, url: simulated, settings: {limit_c: [0, 60]}}}",
        "limit_c",
    ),
    "reversed limits": (
        "instruments: {oven: {driver: omega_cn7500, url: simulated, settings: {limits_c: [60, 0]}}}",
        "limits_c",
    ),
    "no instruments": ("sensor: {name: A}", "key instruments"),
}
PLANS = [  # a procedure, a setting and its value
    ("sweep", "step-deg", "0"),
    ("sweep", "step-deg", "-10"),
    ("sweep", "step-deg", "nan"),
    ("sweep", "step-deg", "ten"),
    ("sweep", "dwell-s", "-1"),
    ("sweep", "dwell-s", "inf"),
    ("sweep", "settle-s", "-3"),
    ("sweep", "inclinations-deg", ""),
    ("sweep", "inclinations-deg", "90,400"),
    ("sweep", "pose-list", "none.csv"),
    ("sweep", "step", "10"),
    ("soak", "hours", "-1"),
    ("noise-floor", "duration-s", "0"),
    ("motion", "amplitude-mm", "1000"),
    ("temperature-cycle", "temperature-c", "300"),
    ("repeat", "times", "0"),
]


@pytest.fixture
def refused(rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[tuple[str, ...]], str]:
    """The message of a command that must be refused; the folder holds good.csv."""
    monkeypatch.chdir(tmp_path)
    Path("good.csv").write_text(GOOD)

    def call(words: tuple[str, ...]) -> str:
        ended = rig(*words)
        assert (ended.status, ended.out) == (2, "")
        assert "rig: " in ended.err
        assert "Traceback" not in ended.err
        assert any(word in ended.err for word in REMEDIES), ended.err
        return str(ended.err)

    return call


@pytest.mark.parametrize("name", TABLES)
def test_a_wrong_table_is_refused_with_its_place(refused: Callable[..., str], name: str) -> None:
    text, place = TABLES[name]
    Path("wrong.csv").write_text(text)
    said = refused(("fit", "wrong.csv", "--model", "linear"))
    assert "wrong.csv" in said
    assert place in said


@pytest.mark.parametrize("name", MODELS)
def test_a_wrong_model_file_is_refused_by_name(refused: Callable[..., str], name: str) -> None:
    Path("wrong.yaml").write_text(MODELS[name])
    assert "wrong.yaml" in refused(("fit", "good.csv", "--model", "wrong.yaml"))


@pytest.mark.parametrize("name", BENCHES)
def test_a_wrong_bench_file_is_refused_with_its_key(refused: Callable[..., str], name: str) -> None:
    text, place = BENCHES[name]
    Path("wrong.yaml").write_text(text)
    said = refused(("check", "--bench", "wrong.yaml"))
    assert "wrong.yaml" in said
    assert place in said


@pytest.mark.parametrize(("procedure", "setting", "value"), PLANS)
def test_a_wrong_setting_is_refused_by_name(
    refused: Callable[..., str], procedure: str, setting: str, value: str
) -> None:
    said = refused(("plan", procedure, f"--{setting}", value))
    assert procedure in said
    assert setting.replace("-", "_") in said
