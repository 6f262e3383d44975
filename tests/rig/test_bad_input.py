"""Names, models, benches and results that cannot be: one message; status 2; nothing written."""

from __future__ import annotations

from collections.abc import Callable
from errno import EACCES
from pathlib import Path
from typing import Any

import pytest
import yaml

from rig.bench import DEFAULT
from tests.rig.conftest import MODEL
from tests.rig.test_analysis_models import OWN

Rig = Callable[..., Any]


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
    def bytes_of(path: Path) -> None:
        raise PermissionError(EACCES, "Permission denied", str(path))

    monkeypatch.setattr("calibrations.reading.text_file._bytes", bytes_of)
    assert "good.csv: cannot be read: Permission denied" in refused("compare", "good.csv", "--model", "linear")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            ("compare", "good.csv", "--model", "liner"),
            'no shipped model and no file is called "liner"; did you mean "linear"?',
        ),
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
        patch.setattr(Path, "write_bytes", denied("model.yaml", "write_bytes"))
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


def test_a_fault_in_the_file_of_an_effect_is_told_with_its_line(refused: Callable[..., str], work: Path) -> None:
    (work / "sag.py").write_text(OWN.replace('p["cube"]', 'p["cub"]'))
    said = refused("add", "sag.py", "--model", "linear", "--data", "good.csv", "--out", "o.yaml")
    assert "sag.py, line 17: KeyError: 'cub'" in said


@pytest.mark.sockets
def test_an_instrument_that_cannot_be_reached(refused: Callable[..., str], bench_file: Callable[..., Path]) -> None:
    instruments = yaml.safe_load(DEFAULT.read_text())["instruments"]
    instruments["adc"] |= {"url": "tcp://127.0.0.1:1"}
    bench = str(bench_file({"instruments": instruments}))
    said = refused("run", "sweep", "--unattended", "--bench", bench, status=3)
    assert "adc (labjack_t7) at tcp://127.0.0.1:1" in said
