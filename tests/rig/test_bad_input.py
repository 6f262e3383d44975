"""Names, models, benches and results that cannot be: one message; status 2; nothing written."""

from __future__ import annotations

from collections.abc import Callable
from errno import EACCES
from pathlib import Path
from typing import Any

import pytest
import yaml

from rig.bench import DEFAULT
from rig.record import Record
from tests.rig.conftest import MODEL, Rig
from tests.rig.test_analysis_models import OWN


def test_data_that_is_neither_a_file_nor_a_run_is_refused(refused: Callable[..., str], rig: Rig) -> None:
    run = rig("import", "good.csv").out.partition(":")[0]
    said = refused("compare", f"{run[:-1]}x")
    assert f"{run[:-1]}x: there is no such file, and no run" in said
    assert f"Did you mean '{run}'?" in said
    assert "nowhere.csv: " in refused("diagnose", "nowhere.csv")


def test_a_path_without_a_file_is_no_run(refused: Callable[..., str], work: Path) -> None:
    """A path is not RUN/SENSOR: the message is about the folder, or proposes the most similar file there."""
    no_folder = refused("compare", f"{work}/nowhere/good.csv")
    assert f"{work}/nowhere/good.csv: there is no such file, and no folder {work}/nowhere" in no_folder
    for path in (f"{work}/god.csv", "./god.csv"):
        assert "god.csv: there is no such file. Did you mean 'good.csv'?" in refused("compare", path)


def test_an_empty_record_gives_a_message(rig: Rig) -> None:
    Record().close()
    for command in ("show", "fit"):
        ended = rig(command, "last")
        assert ended.status == 2
        assert "is empty; `rig run sweep` makes a run" in ended.err


def test_a_procedure_is_run_by_rig_run(refused: Callable[..., str]) -> None:
    assert "'sweep' is a procedure; run it with: rig run sweep --step-deg 30" in refused("sweep", "--step-deg", "30")


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

    monkeypatch.setattr("calibrations.files._bytes", bytes_of)
    assert "good.csv: cannot be read: Permission denied" in refused("compare", "good.csv", "--model", "linear")


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
def test_faults_of_a_model_file_are_named(
    refused: Callable[..., str], work: Path, old: str, new: str, says: str
) -> None:
    assert old in MODEL
    (work / "bad.yaml").write_text(MODEL.replace(old, new, 1))
    assert says in refused("compare", "good.csv", "--model", "bad.yaml", "--json")


def test_a_binary_model_file_is_refused(refused: Callable[..., str], work: Path) -> None:
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
    assert "no/model.yaml: there is no folder no; make it, or give another file" in said
    assert "good.csv: this would overwrite the input file good.csv; give another file" in refused(
        *command, "--out", "good.csv"
    )
    assert "mine.yaml: this would overwrite the input file mine.yaml; give another file" in refused(
        *command, "--out", "mine.yaml"
    )
    assert "is a directory" in refused(*command, "--out", ".")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", denied("model.yaml", "write_bytes"))
        said = refused(*command, "--out", "model.yaml")
    assert "model.yaml: cannot write the file: Permission denied; give another file" in said


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("instrumets: {}\n", "bench.yaml, key instrumets: no such key. Did you mean 'instruments'?"),
        ("- a\n", "bench.yaml: the bench file is not a mapping"),
        ("a: [\n", "bench.yaml: the bench file is not YAML"),
        ("a: 2001-99-99\n", "bench.yaml: the bench file is not YAML: month must be in 1..12"),
        ("[" * 1200, "bench.yaml: the bench file is not YAML"),
        ({"folders": {"effect": "mine"}}, "bench.yaml, key folders.effect: no such key. Did you mean 'effects'?"),
        ({"folders": {"effects": "nowhere"}}, "bench.yaml, key folders.effects: there is no folder"),
    ],
)
def test_faults_of_a_bench_file_are_named(
    refused: Callable[..., str], bench_file: Callable[..., Path], content: Any, says: str
) -> None:
    bench = str(bench_file(content))
    for command in (("compare", "good.csv"), ("diagnose", "good.csv"), ("effects",)):
        assert says in refused(*command, "--bench", bench)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("def transduction(", "def transduction", "sag.py, line 17: SyntaxError"),
        (
            "def transduction(",
            "def transductoin(",
            'sag.py, line 4: Sag: an effect has no member "transductoin"; did you mean "transduction"?',
        ),
        (
            "    def transduction",
            "    kinds = ('poss',)\n\n    def transduction",
            'sag.py, line 4: Sag: there is no kind of table "poss"; did you mean "poses"?',
        ),
        ('"""sag: ', '"""', 'sag.py: the docstring of Sag must begin with "sag: what happens."'),
        ("Symptom   ", "What one sees ", 'and have a line "Symptom ..."'),
        ("\n\nclass", "\nimport no_such_module\n\n\nclass", "sag.py, line 3: ModuleNotFoundError: No module named"),
        ("\n\nclass", "\n1 / 0\n\n\nclass", "sag.py, line 3: ZeroDivisionError: division by zero"),
        ("\n\nclass", "\nraise SystemExit(0)\n\n\nclass", "sag.py, line 3: SystemExit: 0"),
        ("class Sag(", "class Sagging(", "sag.py: must define one effect, `class Sag(Effect):`; it defines Sagging"),
        (
            "class Sag(Effect)",
            "class Sag",
            "sag.py: must define one effect, `class Sag(Effect):`; it defines no effect. See",
        ),
        ("cube = Parameter", "_cube = Parameter", "sag.py: Sag has no parameter, as in slope = Parameter("),
        (
            "def transduction(",
            "def _transduction(",
            "sag.py: Sag acts nowhere; define at least one of the methods pose, force, transduction",
        ),
        (
            "typical=1e-2",
            "typical='1e-2'",
            "sag.py, line 15: a parameter: typical is '1e-2'; it must be a number above 0",
        ),
        ('"{out}/g^3"', "3", "sag.py, line 15: the unit of a parameter is 3; write it as text, such as"),
        ("cube = Parameter", "cube = 1.0  # ", 'sag.py, line 4: Sag: an effect has no member "cube"'),
        (
            "    cube =",
            '    needs = "temperature_c"\n    cube =',
            'sag.py, line 4: Sag: needs must be a tuple of names, as in ("temperature_c",)',
        ),
        (
            "    cube =",
            '    exact = "no"\n    cube =',
            "sag.py, line 4: Sag: exact is 'no'; it must be of type bool",
        ),
        (
            "p.cube",
            "p.cub",
            'sag.py, line 18: AttributeError: the effect has no parameter "cub"; did you mean "cube"?',
        ),
        (
            "self, a, table, p",
            "self, a, table",
            "sag.py, line 4: Sag: transduction must be a method: def transduction(self, a, table, p)",
        ),
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


def test_an_error_of_an_effect_file_given_by_path_has_its_line(refused: Callable[..., str], work: Path) -> None:
    (work / "sag.py").write_text(OWN.replace("p.cube", "p.cub"))
    said = refused("add", "sag.py", "--model", "linear", "--data", "good.csv", "--out", "o.yaml")
    assert 'sag.py, line 18: AttributeError: the effect has no parameter "cub"; did you mean "cube"?' in said


@pytest.mark.sockets
def test_an_instrument_that_cannot_be_reached(refused: Callable[..., str], bench_file: Callable[..., Path]) -> None:
    instruments = yaml.safe_load(DEFAULT.read_text())["instruments"]
    instruments["adc"] |= {"url": "tcp://127.0.0.1:1"}
    bench = str(bench_file({"instruments": instruments}))
    said = refused("run", "sweep", "--unattended", "--bench", bench, status=3)
    assert "adc (labjack_t7) at tcp://127.0.0.1:1" in said
