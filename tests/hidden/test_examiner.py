"""The simulator of `tests.benchmark.examiner`: its files, their repeatability, and the size of the hidden cause."""

from __future__ import annotations

import gzip
import json
from collections import Counter
from contextlib import nullcontext
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import calibrations as cal
from calibrations.effects.catalogue import catalogue
from tests.benchmark.examiner import unknown
from tests.benchmark.examiner.__main__ import CATALOGUE, NAMES, OVERLAPPING, wanted, write
from tests.benchmark.examiner.layouts import LAYOUTS
from tests.benchmark.hidden import KINDS

STRENGTH = 30.0
CAUSE_BY_LAYOUT = {
    "nested": ("hysteresis", "Preisach"),
    "alpha_inner": ("hysteresis", "Bouc-Wen"),
    "random": ("adc-nonlinearity", "wrong bit weights"),
    "irregular": ("stage-eccentricity", "exact, with worm wave"),
    "optimal60": ("quadratic-nonlinearity", "cosh"),
    "optimal_and_sweep": ("z-axis-bias", "power, skew"),
    "two_days": ("warm-up-bias", "stretched"),
    "serpentine": ("stage-backlash", "play operator"),
    "large": ("supply-sensitivity", "regulator"),
    "flip_and_mount": ("stage-zero-offset", "both stages"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("examiner"))


def written(folder: Path) -> Path:
    """One set of each layout, each with a cause of its own."""
    causes = {(cause.name, cause.form): cause for cause in CATALOGUE}
    chosen = [replace(causes[key], layouts=(layout,)) for layout, key in CAUSE_BY_LAYOUT.items()]
    write(folder, [("single", [cause], STRENGTH) for cause in chosen], np.random.default_rng(7))
    return folder


def columns(path: Path) -> dict[str, np.ndarray]:
    lines = [line for line in gzip.decompress(path.read_bytes()).decode().splitlines() if not line.startswith("#")]
    values = np.array([line.split(",") for line in lines[1:]], float)
    return dict(zip(lines[0].split(","), values.T, strict=True))


def force(table: dict[str, np.ndarray]) -> np.ndarray:
    """Ideal specific force, g, (n, 3), from the logged angles."""
    none = np.zeros(len(table["t_s"]))
    alpha, beta = np.radians(table["alpha_deg"]), np.radians(table["beta_deg"] + table.get("mount_deg", none))
    turned = np.column_stack([np.sin(alpha) * np.cos(beta), np.sin(alpha) * np.sin(beta), np.cos(alpha)])
    turned[table.get("flip", none) == 1] *= [1, -1, -1]
    return turned


def truths(folder: Path) -> dict[str, dict]:
    return json.loads((folder / "truth.json").read_text())


def test_each_layout_gives_a_table_that_the_analysis_reads(folder: Path) -> None:
    assert set(CAUSE_BY_LAYOUT) == set(LAYOUTS)
    for (name, truth), layout in zip(truths(folder).items(), LAYOUTS, strict=True):
        with pytest.warns(match="t_s starts again") if layout == "two_days" else nullcontext():
            table = cal.read(folder / "sets" / f"{name}.csv.gz")
        assert truth["design"] == layout
        assert truth["causes"] == [CAUSE_BY_LAYOUT[layout][0]]
        assert table.n == truth["poses"]


def test_the_size_of_a_cause_is_that_of_the_truth(folder: Path) -> None:
    for name, truth in truths(folder).items():
        table = columns(folder / "sets" / f"{name}.csv.gz")
        f, left = force(table), []
        for k, column in enumerate(("vx_v", "vy_v")):
            base = f if truth["size_base"] == ["affine"] else f[:, [k]]
            base = np.column_stack([np.ones(len(f)), base])
            left.append(table[column] - base @ np.linalg.lstsq(base, table[column], rcond=None)[0])
        size = np.sqrt(np.mean(np.square(left))) / truth["noise_before_converter_v"]
        assert truth["sizes_in_floors"] == pytest.approx([STRENGTH], rel=0.01), name
        assert size == pytest.approx(truth["sizes_in_floors"][0], rel=0.1), (name, truth["forms"])


def test_the_same_seed_gives_the_same_files(folder: Path, tmp_path: Path) -> None:
    again = written(tmp_path)
    names = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    assert len(names) == len(LAYOUTS) + 1
    for name in names:
        assert (again / name).read_bytes() == (folder / name).read_bytes(), name


def test_the_second_day_starts_the_clock_again_after_a_warm_up(folder: Path) -> None:
    name = next(name for name, truth in truths(folder).items() if truth["design"] == "two_days")
    t = columns(folder / "sets" / f"{name}.csv.gz")["t_s"]
    assert np.flatnonzero(np.diff(t) < 0).tolist() == [len(t) // 2 - 1]


@pytest.mark.parametrize("seed", [1, 20261])
def test_a_folder_has_all_forms_and_keeps_overlapping_causes_apart(seed: int) -> None:
    sets = list(wanted(np.random.default_rng(seed)))
    counts = Counter(kind for kind, _, _ in sets)
    assert counts == dict(zip(KINDS, (60, 30, 18, 30, 24, 16, 8), strict=True))
    assert {cause.form for kind, causes, _ in sets if kind == "single" for cause in causes} == {
        c.form for c in CATALOGUE
    }
    assert Counter(causes[0].name for kind, causes, _ in sets if kind == "unknown") == {
        cause.name: 2 for cause in unknown.CAUSES
    }
    for kind, causes, _ in sets:
        names = [cause.name for cause in causes]
        assert len(set(names)) == len(names)
        if kind in ("pair", "triple"):
            assert not any(frozenset(pair) in OVERLAPPING for pair in combinations(names, 2))
    assert {cause.name for kind, causes, _ in sets if kind == "pair" for cause in causes} == set(NAMES)


def test_the_names_of_the_causes_are_those_of_the_catalogue() -> None:
    assert set(NAMES) <= {effect.name for effect in catalogue().values()}
