"""The wheel, built without a network: what is in it, and that it works without the checkout."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("rig", "procedures", "drivers", "calibrations")
MOST_BYTES = 2_000_000
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    source = tmp_path_factory.mktemp("source")
    for name in PACKAGES:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / file, source)
    out = tmp_path_factory.mktemp("wheel")
    asked = [*PIP, "wheel", "--no-deps", "--no-index", "--no-build-isolation", "--wheel-dir", str(out), str(source)]
    subprocess.run(asked, check=True, capture_output=True, cwd=out)
    return next(out.glob("*.whl"))


@pytest.mark.slow
def test_the_wheel_is_small_and_holds_the_types_and_all_data_files(wheel: Path) -> None:
    assert wheel.stat().st_size < MOST_BYTES
    held = set(ZipFile(wheel).namelist())
    data = {
        str(path.relative_to(ROOT))
        for name in PACKAGES
        for path in (ROOT / name).rglob("*")
        if path.suffix in (".py", ".yaml", ".html", ".css", ".js", ".jinja", ".typed")
        and "__pycache__" not in path.parts
    }
    assert data <= held
    assert not {name.split("/")[0] for name in held if ".dist-info/" not in name} - set(PACKAGES)


@pytest.mark.slow
def test_an_installed_wheel_works_far_from_the_checkout(wheel: Path, tmp_path: Path) -> None:
    folder = tmp_path / "installed"
    install = [*PIP, "install", "--no-deps", "--no-index", "--no-compile", "--target", str(folder), str(wheel)]
    subprocess.run(install, check=True, capture_output=True, cwd=tmp_path)
    path = {**os.environ, "PYTHONPATH": str(folder), "RIG_HOME": str(tmp_path / "home")}

    def said(*command: str) -> str:
        asked = [sys.executable, *command]
        done = subprocess.run(asked, check=False, capture_output=True, text=True, cwd=tmp_path, env=path)
        assert done.returncode == 0, done.stderr
        return done.stdout

    where = said("-c", "import calibrations, rig; print(calibrations.__file__, rig.__file__)").split()
    assert all(Path(file).is_relative_to(folder) for file in where)
    assert "temperature-bias" in said("-m", "rig", "effects")
    code = (
        "import numpy as np, calibrations as cal; beta = np.arange(0.0, 360.0, 10.0);"
        "table = cal.table({'alpha_deg': 0 * beta + 90, 'beta_deg': beta, 'vx_v': 2.5 + np.cos(np.radians(beta))},"
        " 'poses'); print(round(cal.fit(table, 'linear').params['bias.x'].value, 6))"
    )
    assert said("-c", code).strip() == "2.5"
