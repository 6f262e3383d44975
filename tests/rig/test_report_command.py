"""`rig report`: a page, its pictures, both or a clear message; nothing half written."""

from __future__ import annotations

from pathlib import Path

import pytest

from calibrations.importing.foreign import write_csv
from tests.calibrations.test_pictures import warm_table
from tests.rig.conftest import Rig

NAMES = [
    "waterfall",
    "measurement",
    "residual",
    "failure",
    "effect-temperature-bias",
    "shares",
    "place-temperature-bias",
]


@pytest.fixture
def data(tmp_path: Path) -> str:
    write_csv(warm_table(), tmp_path / "warm.csv")
    return str(tmp_path / "warm.csv")


@pytest.mark.slow
def test_the_report_command_writes_a_page_and_pictures(rig: Rig, data: str, tmp_path: Path) -> None:
    out, folder = tmp_path / "page.html", tmp_path / "pictures"
    ended = rig("report", data, "--model", "linear", "--out", str(out), "--pictures", str(folder), "--json")
    document = ended.done().document
    pictures = [str(folder / f"{name}.png") for name in NAMES]
    assert document == {"schema": "rig.report/1", "out": str(out), "pictures": pictures}
    assert all(Path(path).read_bytes().startswith(b"\x89PNG") for path in document["pictures"])
    assert "misses temperature-bias" in out.read_text(encoding="utf-8")
    assert str(tmp_path) not in out.read_text(encoding="utf-8")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["page.html", "pictures", "warm.csv"]


@pytest.mark.slow
def test_the_report_command_writes_pictures_alone(rig: Rig, data: str, tmp_path: Path) -> None:
    ended = rig("report", data, "--pictures", str(tmp_path / "p"), "--format", "svg")
    assert ended.status == 0, ended.err
    assert ended.out.count("written: ") == len(NAMES)
    assert all((tmp_path / "p" / f"{name}.svg").read_text().startswith("<?xml") for name in NAMES)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "nothing to write: give --out FILE.html, --pictures FOLDER, or both"),
        (("--out", "{tmp}/no/page.html"), "make it, or give another file"),
        (("--out", "{tmp}/page.html", "--model", "liner"), 'did you mean "linear"'),
        (("--pictures", "{tmp}/warm.csv"), "is a file"),
    ],
)
def test_bad_usage_writes_nothing(
    rig: Rig, data: str, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    ended = rig("report", data, *(argument.format(tmp=tmp_path) for argument in arguments))
    assert ended.status == 2
    assert message in ended.err
    assert [path.name for path in tmp_path.iterdir()] == ["warm.csv"]
