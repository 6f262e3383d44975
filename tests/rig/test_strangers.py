"""Files of strangers: they are data, they stay in their folder, and no program of theirs is run."""

from __future__ import annotations

import gzip
import logging
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import calibrations as cal
from calibrations import files
from calibrations.errors import DataError, ModelError
from calibrations.files import LONGEST_YAML, load_yaml
from calibrations.importing.foreign import write_csv
from calibrations.model.file import parse_model
from calibrations.table import Table
from drivers.errors import LinkRefused
from drivers.transport.address import Url
from procedures.catalogue import find
from rig.bench import read_bench
from rig.errors import BenchError
from tests.rig.conftest import Rig

BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 10)
)
PAGE = "schema: rig.model/1\nname: mine\neffects:\n- effect: bias\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("!!python/object/apply:os.system ['touch ran']", "could not determine a constructor"),
        ("!!python/name:os.system", "could not determine a constructor"),
        (BOMB, "more than 100000 parts; do not use aliases"),
        ("a: &a [*a]", "contains itself"),
        ("[" * 10_000, "nested too deeply"),
        ("x: " + "y" * LONGEST_YAML, f"the limit is {LONGEST_YAML}"),
        ("2024-13-45", "month must be in 1..12"),
    ],
    ids=["object", "name", "bomb", "itself", "deep", "long", "date"],
)
def test_yaml_is_data_of_bounded_size(text: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=said):
        load_yaml(text)
    with pytest.raises(ModelError, match="is not YAML"):
        parse_model(text, "theirs.yaml")
    path = tmp_path / "bench.yaml"
    path.write_text(text)
    with pytest.raises(BenchError, match=r"bench\.yaml: the bench file is not YAML: "):
        read_bench(path)
    assert not (tmp_path / "ran").exists()


def test_a_part_may_be_repeated_by_name() -> None:
    assert load_yaml("a: &stage {driver: oriental_az}\nb: *stage\n") == {
        "a": {"driver": "oriental_az"},
        "b": {"driver": "oriental_az"},
    }


STEPS = [
    "__import__('os').system('touch ran')",
    "(lambda: a)()",
    "a.__class__",
    "a*[b for b in (1,)][0]",
    "a*open('ran', 'w')",
    "a*'x'",
    "a*f'{b}'",
    "exec('1')*a",
    "a*sin.__globals__",
    "a if 1 else b",
    "(a := 1)",
    "a*9**9**9**9**9",
]


@pytest.mark.parametrize("expression", STEPS)
def test_an_expression_does_not_reach_python(expression: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = PAGE + f'- effect: mine\n  expression: "v += {expression}"\n'
    try:
        parse_model(text, "theirs.yaml")
    except ModelError as refused:
        assert "theirs.yaml" in str(refused) or "v +=" in str(refused)  # noqa: PT017
    else:
        assert expression == STEPS[-1], "only arithmetic is taken"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("way", ["../secret.csv", "/etc/passwd", "in/../../secret.csv", "~/secret.csv"])
@pytest.mark.parametrize("what", ["curve", "error_table", "folder"])
def test_a_bench_file_names_nothing_outside_its_folder(bench_file: Callable[..., Path], what: str, way: str) -> None:
    changes: dict[str, Any] = {
        "curve": {"d63": {"curve": way}},
        "error_table": {"instruments": {"alpha": {"driver": "manual_stage", "url": "person", "error_table": way}}},
        "folder": {"folders": {"effects": way}},
    }[what]
    with pytest.raises(
        BenchError, match=r"is outside the folder of the bench file|No such file|there is no folder"
    ) as no:
        read_bench(bench_file(changes))
    assert "root:" not in str(no.value)
    if not way.startswith("~"):  # which is a name like another
        assert "outside the folder of the bench file; move or link it into" in str(no.value)


def test_a_link_that_a_person_has_put_there_may_lead_out(bench_file: Callable[..., Path], tmp_path: Path) -> None:
    elsewhere = tmp_path.parent / f"{tmp_path.name}-elsewhere"
    elsewhere.mkdir()
    (tmp_path / "mine").symlink_to(elsewhere)
    assert read_bench(bench_file({"folders": {"effects": "mine"}})).folders.effects == elsewhere


def test_a_model_file_loads_no_effect_from_its_folder(
    tmp_path: Path, rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "evil.py").write_text("open('ran', 'w')")
    (tmp_path / "theirs.yaml").write_text(PAGE + "- effect: evil\n")
    (tmp_path / "data.csv").write_text("alpha_deg,beta_deg,vx_v\n" + "".join(f"90,{10 * k},2.5\n" for k in range(36)))
    monkeypatch.chdir(tmp_path)
    ended = rig("fit", "data.csv", "--model", "theirs.yaml", "--out", "out.yaml")
    assert (ended.status, 'unknown effect "evil"' in ended.err) == (2, True)
    assert not (tmp_path / "ran").exists()


def test_a_users_procedure_gives_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "mine.py"
    path.write_text('"""mine: nothing.\n"""\ndef mine(rig):\n    pass\n')
    with caplog.at_level(logging.WARNING):
        find("mine", tmp_path)
    assert f"the program runs {path}, because the bench file names its folder" in caplog.text


def test_a_compressed_file_is_no_bomb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "LARGEST_BYTES", 1 << 20)
    path = tmp_path / "bomb.csv.gz"
    path.write_bytes(gzip.compress(b"1,2,3\n" * (1 << 19)))
    assert path.stat().st_size < 1 << 14
    with pytest.raises(DataError, match="holds more than"), files.open_text_file(path).lines() as lines:
        assert sum(1 for _ in lines) < 0


def test_a_compressed_line_without_an_end_is_refused_early(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "LONGEST_LINE_BYTES", 1 << 20)
    path = tmp_path / "bomb.csv.gz"
    path.write_bytes(gzip.compress(b"t_s,vx_v\n" * 1_000_000 + b"1" * (1 << 22)))
    with pytest.raises(DataError, match="a line has more than 1 MiB"), files.open_text_file(path).lines() as lines:
        assert sum(1 for _ in lines) < 0


def test_a_line_break_in_a_name_makes_no_constant_in_an_export(tmp_path: Path) -> None:
    columns = {"alpha_deg": [90.0, 90.0], "beta_deg": [0.0, 90.0], "vx_v": [2.5, 3.5]}
    name = "ADXL203\n# gravity_m_s2: 1.6\rbeta\u2028gamma"
    write_csv(Table.from_columns("poses", columns, {"sensor": name, "gravity_m_s2": 9.8}, "x"), tmp_path / "out.csv")
    constants = cal.read(tmp_path / "out.csv").constants
    assert (constants["gravity_m_s2"], sorted(constants)) == (9.8, ["gravity_m_s2", "sensor"])


WRITERS = (
    ("export", "data.csv", "--format", "csv", "--out", "device"),
    ("plan", "sweep", "--step-deg", "45", "--out", "device"),
    ("draw", "--alpha", "45", "--beta", "90", "--out", "device.svg"),
    ("doctor", "--out", "device"),
)


@pytest.mark.parametrize("words", WRITERS, ids=lambda words: words[0])
def test_a_device_is_not_overwritten(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("data.csv").write_text("alpha_deg,beta_deg,vx_v\n90,0,2.5\n90,90,3.5\n")
    os.mkfifo(words[-1])
    ended = rig(*words)
    assert (ended.status, "is not a regular file" in ended.err) == (2, True)
    assert Path(words[-1]).is_fifo()


def test_one_time_for_all_poses_is_no_fault_of_the_program(rig: Rig, tmp_path: Path) -> None:
    rows = (f"{a},{b},{2.5 + math.sin(a) * math.cos(b):.4f},100" for a in (90, 45) for b in range(0, 360, 15))
    (tmp_path / "data.csv").write_text("\n".join(["alpha_deg,beta_deg,vx_v,t_s", *rows]))
    ended = rig("fit", str(tmp_path / "data.csv"), "--out", str(tmp_path / "out.yaml"))
    assert ended.status in (0, 1), ended.err


def test_an_archive_named_as_an_array_is_refused(golden, rig: Rig, tmp_path: Path) -> None:
    np.savez(tmp_path / "two.npz", a=np.zeros(9))
    (tmp_path / "two.npz").rename(tmp_path / "two.npy")
    ended = rig("noise", str(tmp_path / "two.npy"), "--rate", "100")
    assert ended.status == 2
    golden.same(ended.err)


def test_a_model_with_a_scale_of_zero_is_refused(golden) -> None:
    scale = "- effect: scale-factor\n  parameters:\n  - {name: scale, axis: x, value: 0.0, unit: V/g}\n"
    with golden.refused(ModelError):
        parse_model(PAGE + scale, "zero.yaml")


ADDRESS = "tcp://me:hush@192.168.1.40:502"


def test_an_address_has_no_password() -> None:
    with pytest.raises(LinkRefused, match=r"'tcp://\*\*\*@192.168.1.40:502' has a user name; remove it"):
        Url.parse(ADDRESS)


@pytest.mark.parametrize("key", ["url", "stream_url"])
def test_a_bench_with_a_password_is_refused_before_anything_is_kept(bench_file: Callable[..., Path], key: str) -> None:
    part = {"driver": "labjack_t7", "url": "tcp://192.168.1.40:502", "settings": {"channels": {"vx": 0}}}
    with pytest.raises(BenchError, match=rf"key instruments.adc.{key}: .*has a user") as refused:
        read_bench(bench_file({"instruments": {"adc": part | {key: ADDRESS}}}))
    assert "hush" not in str(refused.value)
