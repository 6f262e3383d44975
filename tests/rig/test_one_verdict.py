"""One question has one answer: every command, the page's session, the report and JSON give the same verdict."""

from __future__ import annotations

import json
import subprocess
import sys
from ast import literal_eval
from collections.abc import Callable, Mapping
from contextlib import redirect_stderr, redirect_stdout
from functools import cache, cached_property
from html import unescape
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibrations.criteria import SIGNIFICANT
from calibrations.discovery.results import Diagnosis
from calibrations.discovery.verdict import Verdict, decide
from calibrations.importing.foreign import write_csv
from calibrations.table import Table
from rig.cli import main
from rig.services.request import Request
from rig.services.session import ModelSession, model_session
from tests.browser.measured import wandering
from tests.calibrations import shaken, synthetic, test_common_floor, turned
from tests.rig.conftest import Rig
from tests.slow import before_release

MOST_STEPS = 20
MOST_MODULES = 150
LIKELY = 0.5


def _poses() -> Table:
    """A package turned by 2 deg about z, and a cubic output of x."""
    columns = synthetic.turns((90, 30, 150), step_deg=20.0)
    x, y, _ = synthetic.components(columns)
    return synthetic.poses(columns, 2.5 + x + 0.035 * y + 4e-3 * x**3, 2.5 + y - 0.035 * x)


def _clean_poses() -> Table:
    columns = synthetic.turns((90, 30, 150), step_deg=20.0)
    x, y, _ = synthetic.components(columns)
    return synthetic.poses(columns, 2.5 + x, 2.5 + y)


def _unexplained_poses(step_deg: float) -> Table:
    """The fifth harmonic of the stage angle in x, which no effect of the catalogue has."""
    columns = synthetic.turns((90, 30), step_deg)
    x, y, _ = synthetic.components(columns)
    return synthetic.poses(columns, 2.5 + x + 2e-3 * np.sin(5 * np.radians(columns["beta_deg"])), 2.5 + y)


def _positions() -> Table:
    """Scale factors that differ between the axes, and noise that a column states."""
    a = 9.81 * (test_common_floor.upper(40, -1.0, 3) * [1.02, 0.99, 1.01] + [0.1, -0.08, 0.15])
    a += 1e-3 * np.random.default_rng(3).standard_normal(a.shape)
    columns = dict(zip(("ax", "ay", "az"), a.T, strict=True))
    columns |= {f"{name}_std": np.full(len(a), 1e-2) for name in columns} | {"n": np.full(len(a), 100.0)}
    return Table.from_columns("positions", columns, {"unit": "m/s2"}, "positions")


TABLES: Mapping[str, Callable[[], Table]] = {
    "poses": _poses,
    "clean poses": _clean_poses,
    "unexplained poses": lambda: _unexplained_poses(50.0),
    "unexplained poses, by places": lambda: _unexplained_poses(24.0),
    "positions": _positions,
    "positions without stated noise": lambda: test_common_floor.accelerometer(3),
    "fields": test_common_floor.magnetometer,
    "rates": lambda: turned.gyroscope(4, lean_deg=2.0, per_g=0.6),
    "motion": lambda: shaken.record(shaken.TWO, 10.0, 1, turn_deg=(0.0, 1.5, 2.0)),
}
# their searches take seconds each
SLOW = ("poses", "unexplained poses, by places", "positions without stated noise", "motion")
KINDS = [pytest.param(kind, marks=pytest.mark.slow) if kind in SLOW else kind for kind in (*TABLES, "still")]


class Answers:
    """What each command and the page's session say of one file; each is asked once."""

    def __init__(self, data: str, folder: Path) -> None:
        self.data, self.folder = data, folder

    @cache  # noqa: B019 one object for each kind of data
    def text(self, command: str, *options: str) -> str:
        """What a command prints."""
        with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err, pytest.raises(SystemExit) as ended:
            main((command, self.data, *options))
        assert not ended.value.code, err.getvalue()
        return out.getvalue()

    def document(self, command: str) -> dict[str, Any]:
        """What it prints with --json."""
        made: dict[str, Any] = json.loads(self.text(command, "--json"))
        return made

    @cached_property
    def session(self) -> tuple[ModelSession[Any], list[Diagnosis[Any]]]:
        """The session that adds what it proposes until it proposes nothing, and its diagnoses."""
        session = model_session(Request(self.data))
        seen = [session.diagnosed()]
        while seen[-1].missing:
            assert len(seen) < MOST_STEPS
            session = session.with_step(session.tried(seen[-1].candidates[0].effect))
            seen.append(session.diagnosed())
        return session, seen


@pytest.fixture(scope="module", params=KINDS)
def answers(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Answers:
    folder = tmp_path_factory.mktemp("data")
    if request.param == "still":
        return Answers(wandering(folder), folder)
    write_csv(TABLES[request.param](), path := folder / f"{request.param.replace(' ', '-')}.csv")
    return Answers(str(path), folder)


@pytest.mark.slow
def test_all_commands_and_the_page_agree_on_a_file(answers: Answers) -> None:
    agree(answers)
    assert (answers.document("diagnose")["verdict"] == "unexplained") is ("unexplained" in answers.data)


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", [("noise-floor", "--duration-s", "600"), *before_release([(("sweep", "--step-deg", "45"),)])]
)
def test_all_answers_agree_on_runs_of_the_default_rig(rig: Rig, tmp_path: Path, words: tuple[str, ...]) -> None:
    made = rig("run", *words, "--unattended", "--json")
    agree(Answers(made.document["run"], tmp_path))


def agree(answers: Answers) -> None:
    """Diagnosis, discovery, comparison and session give one answer."""
    diagnosis, discovery = answers.document("diagnose"), answers.document("discover")
    session, seen = answers.session
    first, last = seen[0], seen[-1]

    # the given model
    assert diagnosis["verdict"] == first.verdict == decide(first.judgement)
    assert diagnosis["missing"] == list(first.missing) == [step["added"] for step in discovery["steps"]]
    assert diagnosis["alternatives"] == discovery["alternatives"]
    assert diagnosis["residual_structure"] == discovery["residual_structure"]
    assert [c["effect"] for c in diagnosis["candidates"]] == [c.name for c in first.candidates]

    # the final model
    assert list(session.names) == [step["added"] for step in discovery["steps"]]
    assert last.verdict == discovery["verdict"]
    assert set(discovery["causes"]) | set(discovery["refinements"]) == set(session.names)
    if discovery["steps"]:
        assert session.end.pooled_excess == pytest.approx(discovery["steps"][-1]["excess_after"], rel=1e-6)

    # a comparison fails where effects are missing, unless its own residual is the only measure of the noise
    comparison = answers.document("compare")
    assert bool(comparison["fails"]) or not first.missing or not first.findings.data.is_noise_known(first.fit)
    assert comparison["rmse"].keys() == comparison["noise_floor"].keys()


@pytest.mark.slow
def test_commands_and_report_print_the_same_verdict(answers: Answers, undrawn: None) -> None:
    diagnosis = answers.session[1][0].judgement
    assert diagnosis.text in answers.text("diagnose")
    assert answers.document("diagnose")["text"] == diagnosis.text
    discovery = answers.document("discover")
    assert discovery["text"] in answers.text("discover")
    page = answers.folder / "report.html"
    answers.text("report", "--out", str(page))
    words = unescape(page.read_text()).replace("\u00a0", " ")
    assert discovery["text"].partition(". ")[0].rstrip(".") in words


def test_a_model_with_a_likely_candidate_is_not_called_complete(answers: Answers) -> None:
    _, seen = answers.session
    for result in seen:
        likely = [c for c in result.candidates if c.probability > LIKELY]
        if likely and not result.missing:
            assert "No effect is missing" not in result.judgement.text
            assert result.verdict is Verdict.UNEXPLAINED or likely[0].name in result.judgement.text
        significant = [c.name for c in result.candidates if c.p_value < SIGNIFICANT]
        if result.verdict is Verdict.ADEQUATE:
            assert not significant


def test_names_are_provisional_until_the_search_has_settled(answers: Answers) -> None:
    result = answers.session[1][0]
    assert result.judgement.provisional is not result.findings.settled
    shown = "Provisional" in answers.text("diagnose")
    assert shown == (bool(result.missing) and not result.findings.settled)
    assert answers.document("diagnose")["provisional"] is not result.findings.settled


LOADED = """
import sys
from rig.cli import main
try:
    main(("discover", sys.argv[1]))
except SystemExit:
    rooms = [name.partition(".")[0] for name in sys.modules]
    print({room: rooms.count(room) for room in ("rig", "procedures", "calibrations", "drivers")}, file=sys.stderr)
"""


def test_a_discovery_on_a_file_loads_no_instrument_and_no_simulation() -> None:
    """Where no experiment is to be planned."""
    path = Path(__file__).parents[1] / "golden" / "files" / "thermal.csv"
    ended = subprocess.run([sys.executable, "-c", LOADED, str(path)], capture_output=True, text=True, check=True)
    loaded = literal_eval(ended.stderr.splitlines()[-1])
    assert (loaded["drivers"], loaded["procedures"]) == (0, 0)
    assert sum(loaded.values()) <= MOST_MODULES
