"""`rig noise`, `rig diagnose` and `rig discover` name the same processes and the same disturbances of every record."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.calibrations import hidden_noise
from tests.calibrations.hidden_noise import RATE_HZ, RECORDS, SAMPLES, telegraph, walk, white
from tests.rig.conftest import Rig
from tests.slow import slow

Array = np.ndarray
Random = np.random.Generator
K = np.arange(SAMPLES)


def followed(random: Random) -> dict[str, Array]:
    warm = hidden_noise.room(random)
    return {"vx_v": white(random) + 0.8 * warm, "temperature_c": warm}


def two_axes(random: Random) -> dict[str, Array]:
    """The temperature moves both outputs; the noise of one of them walks."""
    warm = hidden_noise.room(random)
    x, y = white(random) + 0.8 * warm, white(random) + 0.6 * warm + 0.02 * walk(random)
    return {"vx_v": x, "vy_v": y, "temperature_c": warm}


DISTURBED: Mapping[str, tuple[Callable[[Random], dict[str, Array]], set[tuple[str, str]], set[str]]] = {
    "a step": (lambda r: {"vx_v": white(r) + 0.4 * (K > 7000)}, {("step", "x")}, set()),
    "a drift": (lambda r: {"vx_v": white(r) + 0.4 * K / SAMPLES}, {("drift", "x")}, set()),
    "a followed column": (followed, {("follows", "x")}, set()),
    "two axes": (two_axes, {("follows", "x"), ("follows", "y")}, {"rate-random-walk"}),
    "wild samples": (lambda r: {"vx_v": white(r) + 40.0 * (K == 5000)}, {("wild-samples", "x")}, set()),
    "two levels": (
        lambda r: {"vx_v": white(r) + 2.5 * telegraph(r, SAMPLES, 500.0)}, {("two-levels", "x")}, {"gauss-markov-noise"}
    ),
    "a changing level": (lambda r: {"vx_v": white(r) * np.where(K > 15_000, 1.5, 1.0)}, {("level", "x")}, set()),
}  # fmt: skip


OF_TEMPERATURE = {"temperature-bias"}  # to `rig noise` an output that follows the temperature is a disturbance


def answers(rig: Rig, *data: str) -> dict[str, dict[str, Any]]:
    """The documents of the three commands."""
    ended = {command: rig(command, *data, "--json") for command in ("noise", "diagnose", "discover")}
    assert {command: each.status for command, each in ended.items()} == dict.fromkeys(ended, 0), ended["noise"].err
    return {command: each.document for command, each in ended.items()}


def named(document: Mapping[str, Any]) -> set[str]:
    """The processes that `rig noise` names in any channel, besides white noise; some with alternatives."""
    every = [pair for channel in document["channels"].values() for pair in channel["coefficients"].items()]
    return {name for name, each in every if each["identified"] or each["alternatives"]} - {"white-noise"}


def agree(found: Mapping[str, dict[str, Any]]) -> None:
    processes = named(found["noise"])
    assert processes == set(found["discover"]["causes"]) - OF_TEMPERATURE
    best = [c["effect"] for c in found["diagnose"]["candidates"] if c["effect"] not in OF_TEMPERATURE]
    assert processes == set(best[: len(processes)])
    noise, *others = (
        [(each["kind"], each["axis"], each["text"], each["matters"]) for each in found[command]["disturbances"]]
        for command in ("noise", "diagnose", "discover")
    )
    assert [noise, noise] == others
    for name, coefficient in found["noise"]["coefficients"].items():
        assert set(coefficient["alternatives"]) <= set(found["discover"]["alternatives"].get(name, ()))


def written(folder: Path, columns: Mapping[str, Array]) -> str:
    file = folder / "still.csv"
    rows = np.column_stack([K / RATE_HZ, *columns.values()])
    np.savetxt(file, rows, delimiter=",", header=",".join(["t_s", *columns]), comments="", fmt="%.9g")
    return str(file)


@pytest.mark.parametrize("name", RECORDS)
def test_three_commands_name_the_same_processes(rig: Rig, tmp_path: Path, name: str) -> None:
    make, truth = RECORDS[name]
    np.save(tmp_path / "still.npy", make(np.random.default_rng(5)))
    found = answers(rig, str(tmp_path / "still.npy"), "--rate", str(RATE_HZ))
    agree(found)
    assert named(found["noise"]) == truth


@pytest.mark.parametrize("name", [*slow(["two axes"]), *(name for name in DISTURBED if name != "two axes")])
def test_three_commands_name_the_same_disturbances(rig: Rig, tmp_path: Path, name: str) -> None:
    make, kinds, processes = DISTURBED[name]
    found = answers(rig, written(tmp_path, make(np.random.default_rng(5))))
    agree(found)
    assert {(each["kind"], each["axis"]) for each in found["noise"]["disturbances"]} == kinds
    assert named(found["noise"]) == processes


@pytest.mark.slow
def test_both_outputs_of_the_default_rig_follow_the_supply_without_a_random_walk(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RIG_HOME", str(tmp_path))
    made = rig("run", "noise-floor", "--duration-s", "600", "--unattended", "--json")
    assert made.status == 0, made.err
    for axes, channel in ((["x", "y"], ()), (["y"], ("--channel", "vy"))):
        found = answers(rig, made.document["run"], *channel)
        agree(found)
        followed = [(each["axis"], each["column"]) for each in found["noise"]["disturbances"]]
        assert followed == [(axis, "supply_v") for axis in axes]
        assert "rate-random-walk" not in named(found["noise"])
