"""Plausible but physically wrong inputs: none of them gives wrong values without a word."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.model.file import dump_model, read_model
from tests.rig.conftest import Rig
from tests.rig.measurement_files import GOOD
from tests.rig.wrong_answers import HARMLESS, REFUSED, SILENT, WARNED, answer
from tests.rig.wrong_measurements import UNSEEN, WRONG
from tests.rig.wrong_page import PAGE, answers, listed, unseen
from tests.slow import before_release, slow

REMEDIES = (
    *(
        "check",
        "choose",
        "must be from",
        "must be 1 ",
        "must be at least",
        "correct",
        "exchange",
        "give",
        "import",
        "leave",
        "measure",
        "remove",
        "separate",
        "sort",
    ),
    *("state", "turn", "use values", "used once"),
)
SILENT_TODAY = [(kind, name) for kind, cases in UNSEEN.items() for name in cases]


@pytest.mark.parametrize("kind", ["poses", "positions", "rates", "fields"])
def test_a_good_file_has_no_remark(kind: str, tmp_path: Path) -> None:
    good = GOOD[kind]()
    (tmp_path / "good.csv").write_text(good.text())
    assert (answer(tmp_path / "good.csv", good.model).text) == ""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_every_wrong_input_gets_a_message(tmp_path: Path) -> None:
    found = {(kind, name): each for kind, name, each in answers(tmp_path)}
    assert {case: each.kind for case, each in found.items()} == listed()
    for case, each in found.items():
        assert each.kind in (REFUSED, WARNED, HARMLESS), case
        assert each.kind == HARMLESS or any(word in each.text for word in REMEDIES), (case, each.text)


def test_the_page_lists_every_input_and_none_is_silent() -> None:
    rows = listed()
    assert set(rows) == {(kind, name) for kind, cases in WRONG.items() for name in cases}
    assert len(rows) >= 60
    assert SILENT not in rows.values()
    assert unseen() in PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize(("kind", "name"), SILENT_TODAY)
def test_faults_that_a_file_cannot_show_are_listed(kind: str, name: str, tmp_path: Path) -> None:
    """If one of these is found one day, it moves to the battery."""
    wrong = UNSEEN[kind][name][0](GOOD[kind]())
    (tmp_path / "wrong.csv").write_text(wrong.text())
    assert answer(tmp_path / "wrong.csv", wrong.model).kind == SILENT


SAID = {
    "beta with wrong steps a turn": "beta_deg is multiplied by 0.8",
    "time in milliseconds": "in which no stage turns",
    "both outputs are saturated at the supply": "at its highest value the output or the converter is saturated",
}


@pytest.mark.parametrize(("command", "stage"), [("fit", "alpha"), ("fit", "beta"), ("compare", "alpha")])
def test_a_stage_zero_that_is_off_is_named_unless_the_model_has_it(
    rig: Rig, tmp_path: Path, command: str, stage: str
) -> None:
    wrong = WRONG["poses"][f"the zero of {stage} is off by 3 deg"](GOOD["poses"]())
    (tmp_path / "wrong.csv").write_text(wrong.text())
    extended = read_model("linear").with_effect(catalogue()["stage-zero-offset"])
    (tmp_path / "extended.yaml").write_text(dump_model(extended))
    linear = rig(command, str(tmp_path / "wrong.csv"), "--model", "linear")
    assert f"if the zero of {stage}_deg is -3 deg off" in linear.out
    complete = rig(command, str(tmp_path / "wrong.csv"), "--model", str(tmp_path / "extended.yaml"))
    assert "deg off" not in complete.out + complete.err


@pytest.mark.parametrize(
    ("command", "name"),
    [
        *product(("fit", "compare"), SAID),
        *product(("diagnose", "discover"), list(SAID)[:2]),
        *slow(product(("diagnose",), list(SAID)[2:])),  # a search of seconds
        *before_release(product(("discover",), list(SAID)[2:])),
    ],
)
def test_every_command_names_a_wrong_input(rig: Rig, tmp_path: Path, command: str, name: str) -> None:
    wrong = WRONG["poses"][name](GOOD["poses"]())
    (tmp_path / "wrong.csv").write_text(wrong.text())
    ended = rig(command, str(tmp_path / "wrong.csv"), "--model", "linear", "--json")
    assert SAID[name] in ended.err + str(ended.document["residual_structure"])
