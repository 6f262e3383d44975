"""Numbers that cannot be what their column says: one message with the way out; status 2; nothing written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from calibrations.files import LARGEST_BYTES
from tests.rig.test_analysis_models import OWN

Refused = Callable[..., str]
TURN = range(0, 360, 30)


def poses(*more: str, alpha: float = 90.0, scale: float = 1.0, volts: float = 1.0) -> str:
    """A turn of beta as CSV; `more` are further cells of each row, the first their header."""
    head, *cells = more or ("",)
    rows = [",".join([f"{scale * alpha:g},{scale * b:g},{volts * (2.5 + b / 1e3):g}", *cells]) for b in TURN]
    return "\n".join([",".join(["alpha_deg,beta_deg,vx_v", *([head] if head else [])]), *rows]) + "\n"


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (poses(scale=0.0174533), "--column alpha_deg=alpha_deg:rad --column beta_deg=beta_deg:rad"),
        (poses(volts=1000.0), "rig import bad.csv --kind poses --column vx_v=vx_v:mV"),
        (poses("temperature_c", "295.1"), "--column temperature_c=temperature_c:K"),
        (poses("supply_v", "0"), 'bad.csv: row 1, column "supply_v" is 0; it must be above 0: without supply there is'),
        ("ax,ay,az\n" + "1e200,1,2\n2,3e200,1\n" * 9, 'row 1, column "ax" is 1e+200, more than anything measured'),
        ("# unit: g\nax,ay,az\n" + "9.8,0,1\n0,9.8,0\n0,1,9.8\n" * 5, "a sensor at rest shows 1; they look like"),
    ],
    ids=["radians", "millivolts", "kelvin", "no-supply", "astronomic", "m/s2"],
)
def test_numbers_in_wrong_units_are_refused(refused: Refused, work: Path, content: str, says: str) -> None:
    (work / "bad.csv").write_text(content)
    for command in (("fit", "bad.csv", "--out", "out.yaml"), ("diagnose", "bad.csv"), ("import", "bad.csv")):
        assert says in refused(*command)


@pytest.mark.parametrize("size", [2 * LARGEST_BYTES, LARGEST_BYTES // 2])
def test_a_huge_empty_file_is_refused_at_once(
    refused: Refused, work: Path, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (work / "huge.csv").open("wb") as file:
        file.truncate(size)
    monkeypatch.setattr("tests.rig.conftest.contents", lambda folder: sorted(folder.iterdir()))  # reads no GiB
    for command in ("fit", "import"):
        said = refused(command, "huge.csv")
        assert "the limit is 1 GiB" in said or "is not text (byte 0 is 0x00)" in said


def test_a_compensation_is_not_written_for_a_model_whose_units_differ(refused: Refused, work: Path) -> None:
    """Otherwise the header of the C file says mV, and its arithmetic is in V."""
    (work / "mixed.yaml").write_text((work / "mine.yaml").read_text().replace("unit: V", "unit: mV", 1))
    said = refused("compensate", "mixed.yaml", "--language", "c", "--out", "c")
    assert 'mixed.yaml: bias: the unit of "bias" x is V, and must be mV in a model with `unit: mV`' in said
    assert not (work / "c").exists()


def test_a_search_for_a_run_makes_no_record(
    rig: Callable[..., object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RIG_HOME", str(tmp_path / "home"))
    ended = rig("compare", "nowhere")
    assert getattr(ended, "status", 0) == 2
    assert "no record yet" in getattr(ended, "err", "")
    assert not (tmp_path / "home").exists()


def test_an_effect_of_ones_own_takes_no_shipped_name(
    refused: Refused, work: Path, bench_file: Callable[..., Path]
) -> None:
    (work / "bias.py").write_text(OWN.replace("class Sag", "class Bias").replace("sag: ", "bias: "))
    bench = str(bench_file({"folders": {"effects": str(work)}}))
    said = refused("diagnose", "good.csv", "--bench", bench)
    assert f"{work}: bias is already" in said


def test_an_unknown_procedure_names_the_nearest(refused: Refused) -> None:
    assert "Did you mean 'sweep'?" in refused("run", "swep", "--unattended")
