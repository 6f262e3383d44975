"""Bad input to the analysis commands: one message with what, where and what to do; status 2; nothing written."""

from __future__ import annotations

import gzip
from collections.abc import Callable, Mapping
from errno import EACCES
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from calibrations.read_csv import write_csv
from rig.bench import DEFAULT
from rig.record import Record
from tests.calibrations.synthetic import components, poses, turns
from tests.rig.test_analysis_models import OWN

Rig = Callable[..., Any]
MODEL = """schema: rig.model/1
name: mine
unit: V
effects:
- effect: bias
  parameters:
  - {name: bias, axis: x, value: 2.5, std: 1.0e-5, unit: V}
  - {name: bias, axis: y, value: 2.5, std: 1.0e-5, unit: V}
- effect: scale-factor
"""


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A good table of poses, as CSV: line 1 is its header, line 4 holds beta 60."""
    columns = turns((90, 30), step_deg=30.0)
    x, y, _ = components(columns)
    path = tmp_path_factory.mktemp("good") / "good.csv"
    write_csv(poses(columns, 2.5 + x, 2.5 + y), path)
    return path.read_text()


@pytest.fixture
def work(tmp_path: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that commands are called in, with one good table and one good model."""
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    (folder / "good.csv").write_text(text)
    (folder / "mine.yaml").write_text(MODEL)
    return folder


@pytest.fixture
def refused(rig: Rig, work: Path) -> Callable[..., str]:
    """Call a command that must fail, and nothing else; its message."""

    def call(*arguments: str, status: int = 2) -> str:
        with Record() as record:
            runs = record.runs()
        before = contents(work)
        ended = rig(*arguments)
        assert ended.status == status, ended.out + ended.err
        assert ended.out == ""
        assert "Traceback" not in ended.err
        assert contents(work) == before
        with Record() as record:
            assert record.runs() == runs
        return str(ended.err)

    return call


def contents(folder: Path) -> Mapping[str, bytes | None]:
    """Every file below a folder, but for what Python keeps of what it compiled."""
    paths = [path for path in sorted(folder.rglob("*")) if "__pycache__" not in path.parts]
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in paths}


def line(text: str, number: int, old: str, new: str) -> str:
    """`text` with a change in one line, counted from 1."""
    lines = text.splitlines()
    assert old in lines[number - 1]
    lines[number - 1] = lines[number - 1].replace(old, new, 1)
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("number", "old", "new", "says"),
    [
        (
            1,
            "beta_deg",
            "beta_dge",
            'bad.csv, line 1: no kind of table has the column "beta_dge"; did you mean "beta_deg"?',
        ),
        (1, "beta_deg", "b", 'bad.csv, line 1: the column "beta_deg" is missing: poses need alpha_deg, beta_deg, vx_v'),
        (1, "vx_v", "vx", 'no kind of table has the column "vx"; did you mean "vx_v"?'),
        (1, "vy_v", "vx_v", 'bad.csv, line 1: the column "vx_v" occurs twice'),
        (1, "vy_v", "", "bad.csv, line 1: a column has no name"),
        (4, "60.0", "sixty", 'bad.csv, line 4, column "beta_deg": "sixty" where a number belongs'),
        (4, "60.0", "", 'bad.csv, line 4, column "beta_deg": empty where a number belongs; correct the cell or remove'),
        (4, "60.0", "nan", 'bad.csv, line 4, column "beta_deg": "nan" is not a finite number'),
        (4, "60.0", "-inf", 'bad.csv, line 4, column "beta_deg": "-inf" is not a finite number'),
        (4, "60.0", "60.0,1", "bad.csv, line 4: 10 values for 9 columns (alpha_deg, beta_deg"),
        (4, ",60.0", "", "bad.csv, line 4: 8 values for 9 columns"),
        (4, "60.0", '"' + "x" * 200_000 + '"', "bad.csv: is not a CSV file: field larger than field limit"),
    ],
)
def test_a_table_with_a_fault(
    refused: Callable[..., str], work: Path, text: str, number: int, old: str, new: str, says: str
) -> None:
    (work / "bad.csv").write_text(line(text, number, old, new))
    assert says in refused("compare", "bad.csv", "--model", "linear", "--json")
    refused("fit", "bad.csv", "--out", "out.yaml")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "bad.csv: the file is empty: a header line with column names is missing"),
        (b"# sensor: mine\n\n", "bad.csv: the file is empty"),
        (b"alpha_deg,beta_deg,vx_v\n", "bad.csv: no rows below the header"),
        (b"90,0,2.5\n90,10,2.5\n", "bad.csv, line 1: a header line with column names is missing"),
        (b"90,90,2.5\n90,10,2.5\n", "bad.csv, line 1: a header line with column names is missing"),
        (b"alpha_deg;beta_deg;vx_v\n90;0;2,5\n", "separated by semicolons, not commas; `rig import` takes them so"),
        (
            b"alpha_deg,beta_deg,vx_v\n90,0,2.5\n",
            "bad.csv: 1 rows cannot determine the 2 parameters of linear; measure",
        ),
        (b"north,east\n1,2\n", "bad.csv, line 1: columns north, east are of no known kind of table; poses need"),
        (bytes(range(256)), "bad.csv: is not UTF-8 text (byte 128); is it really a CSV file?"),
        (b"rate_deg_s,gx,gy,gz\n1,2,3,4\n", "models are fitted to poses or positions, not to a table of rates"),
        (b"# filter_corner_hz: low\n# sample_rate_hz: 1000\nGOOD", "the constant \"filter_corner_hz\" is 'low', not a"),
    ],
)
def test_a_file_that_is_no_table(refused: Callable[..., str], work: Path, text: str, content: bytes, says: str) -> None:
    (work / "bad.csv").write_bytes(content.replace(b"GOOD", text.encode()))
    assert says in refused("fit", "bad.csv", "--model", "linear", "--out", "out.yaml", "--json")


@pytest.mark.parametrize(
    ("head", "row", "says"),
    [
        ("mx,my,mz", (1, 2, 3), "bad.csv: models of positions need the columns ax, ay, az; it has: mx, my, mz"),
        ("ax,ay,az", (1, 0, 3), 'bad.csv: the column "ay" never changes; positions turn each axis up and down'),
        ("ax,ay,az,n", (1, 2, 3, 0), 'bad.csv: row 1, column "n" is 0; it must be at least 1'),
    ],
)
def test_positions_that_cannot_be(
    refused: Callable[..., str], work: Path, head: str, row: tuple[int, ...], says: str
) -> None:
    rows = "\n".join(",".join(str(k * factor) for factor in row) for k in range(20))
    (work / "bad.csv").write_text(f"{head}\n{rows}\n")
    for command in ("fit", "diagnose"):
        assert says in refused(command, "bad.csv", "--model", "linear")


def test_fewer_poses_than_parameters(refused: Callable[..., str], work: Path, text: str) -> None:
    (work / "few.csv").write_text("\n".join(text.splitlines()[:4]))
    for command in ("fit", "compare", "diagnose", "discover"):
        said = refused(command, "few.csv", "--model", "physical")
        assert "few.csv: 3 rows cannot determine the" in said
        assert "measure more poses, or take a smaller model" in said


def test_data_that_is_neither_file_nor_run(refused: Callable[..., str], rig: Rig) -> None:
    run = rig("import", "good.csv").out.partition(":")[0]
    said = refused("compare", f"{run[:-1]}x")
    assert f"{run[:-1]}x: there is no such file, and no run" in said
    assert f"Did you mean '{run}'?" in said
    assert "nowhere.csv: there is no such file" in refused("diagnose", "nowhere.csv")


def test_a_folder_is_no_data(refused: Callable[..., str]) -> None:
    for command in ("fit", "compare", "diagnose", "discover"):
        assert ".: is a folder; name a file in it, or a run (`rig runs` lists them)" in refused(command, ".")
    assert "is a directory" in refused("import", ".")


def denied(name: str, method: str) -> Callable[..., Any]:
    """A method of Path that this user may not use on files with `name` in their names; for root as well."""
    original = getattr(Path, method)

    def call(path: Path, *more: Any, **named: Any) -> Any:
        if name in path.name:
            raise PermissionError(EACCES, "Permission denied", str(path))
        return original(path, *more, **named)

    return call


def test_a_file_that_may_not_be_read(refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "read_text", denied("good.csv", "read_text"))
    assert "good.csv: cannot be read: Permission denied" in refused("compare", "good.csv", "--model", "linear")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("compare", "good.csv", "--model", "liner"), 'unknown model "liner"; did you mean "linear"?'),
        (
            ("compare", "good.csv", "--model", "nowhere.yaml"),
            "nowhere.yaml: the model file cannot be read: No such file",
        ),
        (("compare", "good.csv", "--model", "."), ".: the model file cannot be read: Is a directory"),
        (("effects", "hysterisis"), 'unknown effect "hysterisis"; did you mean "hysteresis"?'),
        (
            ("add", "hysterisis", "--model", "linear", "--data", "good.csv", "--out", "o.yaml"),
            'did you mean "hysteresis"?',
        ),
        (
            ("add", "bias", "--model", "linear", "--data", "good.csv", "--out", "o.yaml"),
            "linear: bias is in the model already; its effects: bias, scale-factor",
        ),
        (
            ("add", "temperature-bias", "--model", "linear", "--data", "good.csv", "--out", "o.yaml"),
            "temperature-bias needs the column temperature_c; good.csv is a table of poses: alpha_deg",
        ),
        (("diagnos", "good.csv"), "no command 'diagnos'. Did you mean 'diagnose'?"),
        (("add", "hysteresis", "--model", "linear", "--data", "good.csv"), "Missing option '--out'"),
        (("fit", "good.csv", "--mdel", "linear"), "No such option"),
        (("report", "good.csv"), "nothing to write: give --out FILE.html, --pictures FOLDER, or both"),
    ],
)
def test_a_name_that_nobody_knows(refused: Callable[..., str], arguments: tuple[str, ...], says: str) -> None:
    assert says in refused(*arguments)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("unit: V\neff", "unti: V\neff", 'bad.yaml, key unti: no such key; did you mean "unit"?'),
        (
            "std: 1.0e-5, unit: V}\n-",
            "sdt: 1.0e-5, unit: V}\n-",
            'key effects.0.parameters.1.sdt: no such key; did you mean "std"?',
        ),
        ("rig.model/1", "rig.model/9", "bad.yaml, key schema: Input should be 'rig.model/1', is 'rig.model/9'"),
        ("schema: rig.model/1\n", "", "bad.yaml, key schema: is missing"),
        (
            "effect: scale-factor",
            "effect: scale-facto",
            'bad.yaml: unknown effect "scale-facto"; did you mean "scale-factor"?',
        ),
        ("value: 2.5", "value: .nan", "key effects.0.parameters.0.value: Input should be a finite number"),
        ("axis: x", "axis: w", "key effects.0.parameters.0.axis: Input should be 'x', 'y' or 'z', is 'w'"),
        ("axis: x", "axis: y", "bad.yaml: bias: bias y is given twice"),
        (MODEL, "a: [1, 2\nb: }", "bad.yaml: is not YAML: while parsing"),
        (MODEL, "- a\n- b\n", "bad.yaml: is not a model: a model file is a mapping that begins with `schema:"),
        (MODEL, "", "bad.yaml: is not a model"),
    ],
)
def test_a_model_file_with_a_fault(refused: Callable[..., str], work: Path, old: str, new: str, says: str) -> None:
    assert old in MODEL
    (work / "bad.yaml").write_text(MODEL.replace(old, new, 1))
    assert says in refused("compare", "good.csv", "--model", "bad.yaml", "--json")


def test_a_binary_model_file(refused: Callable[..., str], work: Path) -> None:
    (work / "bad.yaml").write_bytes(bytes(range(256)))
    assert "bad.yaml: is not text (byte 128); is it really a model file?" in refused(
        "diagnose", "good.csv", "--model", "bad.yaml"
    )


OUT = [
    ("fit", "good.csv", "--model", "mine.yaml"),
    ("discover", "good.csv", "--model", "mine.yaml"),
    ("add", "hysteresis", "--model", "mine.yaml", "--data", "good.csv"),
]


@pytest.mark.parametrize("command", OUT, ids=lambda words: words[0])
def test_a_result_that_cannot_be_written(
    refused: Callable[..., str], command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    said = refused(*command, "--out", "no/model.yaml")
    assert "no/model.yaml: there is no folder no; make it, or name another file" in said
    assert "good.csv: would overwrite good.csv, which this is made from" in refused(*command, "--out", "good.csv")
    assert "mine.yaml: would overwrite mine.yaml" in refused(*command, "--out", "mine.yaml")
    assert "is a directory" in refused(*command, "--out", ".")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_text", denied("model.yaml", "write_text"))
        said = refused(*command, "--out", "model.yaml")
    assert "model.yaml: cannot be written: Permission denied; name another file" in said


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("instrumets: {}\n", "bench.yaml, key instrumets: no such key. Did you mean 'instruments'?"),
        ("- a\n", "bench.yaml: a bench file is a mapping that begins with `instruments:`"),
        ("a: [\n", "bench.yaml: is not a YAML file"),
        ("a: 2001-99-99\n", "bench.yaml: is not a YAML file: month must be in 1..12"),
        ("[" * 1200, "bench.yaml: is not a YAML file"),
        ({"folders": {"effect": "mine"}}, "bench.yaml, key folders.effect: no such key. Did you mean 'effects'?"),
        ({"folders": {"effects": "nowhere"}}, "bench.yaml, key folders.effects: there is no folder"),
    ],
)
def test_a_bench_file_with_a_fault(
    refused: Callable[..., str], bench_file: Callable[..., Path], content: Any, says: str
) -> None:
    bench = str(bench_file(content))
    for command in (("compare", "good.csv"), ("diagnose", "good.csv"), ("effects",)):
        assert says in refused(*command, "--bench", bench)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("\ndef transduction(", "\ndef transduction", "sag.py, line 16: SyntaxError"),
        (
            "def transduction(",
            "def transductoin(",
            "sag.py: is not an effect: it defines none of the functions pose, force",
        ),
        ('"""sag: ', '"""', 'sag.py: its docstring must begin with "name: what happens."'),
        ("Symptom   ", "What one sees ", 'and have a line "Symptom ..."'),
        (
            "\nPARAMETERS",
            "\nimport no_such_module\n\nPARAMETERS",
            "sag.py, line 13: ModuleNotFoundError: No module named",
        ),
        ("\nPARAMETERS", "\n1 / 0\nPARAMETERS", "sag.py, line 13: ZeroDivisionError: division by zero"),
        ("\nPARAMETERS", "\nraise SystemExit(0)\nPARAMETERS", "sag.py, line 13: SystemExit: 0"),
        ("PARAMETERS = (", "VALUES = (", "sag.py: is not an effect: PARAMETERS must be a tuple"),
        ('per cube"),)', 'per cube"))', "sag.py: is not an effect: PARAMETERS must be a tuple"),
        ("typical=1e-2", "typical='1e-2'", "cube: typical is '1e-2'; it must be a number above 0"),
        (
            "\nPARAMETERS",
            '\nNEEDS = "temperature_c"\nPARAMETERS',
            'sag.py: NEEDS must be a tuple of names, as in ("temperature_c",)',
        ),
        ('p["cube"]', 'p["cub"]', "sag.py, line 17: KeyError: 'cub'"),
        ("a, table, p", "a, table", "sag.py: TypeError: transduction() takes 2 positional arguments"),
        ("return p", "p", "sag.py: transduction() must give an array of shape (52, 3), and gave a NoneType"),
        ("a[:, 2:] ** 3", "a[:3]", "sag.py: transduction() must give an array of shape (52, 3), and gave shape (3, 3)"),
        ("** 3", "* float('nan')", "sag.py: transduction() gave numbers that are not finite"),
    ],
)
def test_an_effect_of_ones_own_with_a_fault(
    refused: Callable[..., str], work: Path, bench_file: Callable[..., Path], old: str, new: str, says: str
) -> None:
    assert old in OWN
    (work / "sag.py").write_text(OWN.replace(old, new, 1))
    bench = str(bench_file({"folders": {"effects": str(work)}}))
    assert says in refused("diagnose", "good.csv", "--model", "linear", "--bench", bench)
    refused("add", "sag", "--model", "linear", "--data", "good.csv", "--out", "o.yaml", "--bench", bench)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("nowhere.csv",), "File 'nowhere.csv' does not exist"),
        (("good.csv", "--kind", "pose"), "'pose' is not one of 'poses', 'positions'"),
        (
            ("good.csv", "--column", "vx_v"),
            '"vx_v": a column is given as NAME=THEIRS or NAME=THEIRS:UNIT, such as vx_v=Vout:mV',
        ),
        (("good.csv", "--column", "vx_v=Vot"), 'good.csv: there is no column "Vot"'),
        (("good.csv", "--column", "vx_v=vx_v:mvolt"), 'good.csv: unknown unit "mvolt" of the column "vx_v"'),
        (
            ("good.csv", "--column", "vx_v=vx_v:rad"),
            'good.csv: the column "vx_v" is in V; "vx_v" in rad cannot become that',
        ),
        (("good.csv", "--kind", "positions"), 'good.csv: a table of positions needs the column "ax"'),
        (
            ("good.csv", "--constant", "gravity"),
            '"gravity": a constant is given as KEY=VALUE, such as gravity_m_s2=9.81744',
        ),
        (("empty.csv",), "empty.csv: the file is empty"),
        (("cut.csv.gz",), "cut.csv.gz: cannot be read as text"),
        (
            ("log.csv",),
            "log.csv: a raw log needs the column t_s, or a line such as `# sample_rate_hz: 100` above its header",
        ),
        (("log.csv", "--constant", "sample_rate_hz=0"), 'constant "sample_rate_hz" is 0.0; it must be above 0'),
        (("log.csv", "--constant", "sample_rate_hz=fast"), "the constant \"sample_rate_hz\" is 'fast', not a number"),
        (
            ("log.csv", "--constant", "sample_rate_hz=100"),
            "log.csv: found no still intervals; a log of positions has many of 1 s or more",
        ),
    ],
)
def test_an_import_that_cannot_be(
    refused: Callable[..., str], work: Path, text: str, arguments: tuple[str, ...], says: str
) -> None:
    (work / "empty.csv").write_text("")
    (work / "cut.csv.gz").write_bytes(gzip.compress(text.encode())[:100])
    noise = np.random.default_rng(0).standard_normal((1500, 3)).round(4).tolist()
    (work / "log.csv").write_text("ax,ay,az\n" + "".join(f"{x},{y},{z}\n" for x, y, z in noise))
    assert says in refused("import", *arguments)


@pytest.mark.sockets
def test_an_instrument_that_cannot_be_reached(refused: Callable[..., str], bench_file: Callable[..., Path]) -> None:
    instruments = yaml.safe_load(DEFAULT.read_text())["instruments"]
    instruments["adc"] |= {"url": "tcp://127.0.0.1:1"}
    bench = str(bench_file({"instruments": instruments}))
    said = refused("run", "sweep", "--unattended", "--bench", bench, status=3)
    assert "adc (labjack_t7) at tcp://127.0.0.1:1" in said
