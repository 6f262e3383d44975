"""What a fleet is asked: a user's own effects, other kinds than poses, effects that are needed no longer."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from distributed import Client, LocalCluster

from calibrations.discovery.candidates import candidates
from calibrations.discovery.significance import Screen
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.fleet.look import Score, Screening, SharedDesigns, screen_sensor
from calibrations.importing.foreign import write_csv
from calibrations.model.file import dump_model, read_model
from calibrations.table import Table
from rig.fleet import questions as asked_module
from rig.fleet.discover import discover_fleet
from rig.fleet.members import Member, fleet_of
from rig.fleet.questions import Fleet
from rig.fleet.worker import Question, Task, answer, write_look
from rig.record import Record
from rig.web.pages.fleet import progress_text
from tests.calibrations import turned
from tests.calibrations.fleets import BETA, sensor
from tests.rig.conftest import Rig

RIPPLE = '''import numpy as np

from calibrations.effects import Effect, Parameter


class Ripple(Effect):
    """ripple: the converter's reference follows the table's motor, and the output with it.

        v <- v + a cos(3 beta)      a in {out}; 3 pole pairs

    Symptom   three waves in a turn of beta.
    Excited by  a full turn of beta.
    Confused with  nothing.
    Source    the motor's data sheet.
    """

    kinds = ("poses",)
    wave = Parameter("{out}", typical=1e-3, doc="height")

    def transduction(self, a, table, p):
        return np.cos(3 * np.radians(table.column("beta_deg")))[:, None] * p.wave
'''


def rippled(seed: int) -> Table:
    table = sensor(seed)
    wave = 5e-5 * np.cos(3 * np.radians(BETA))
    return replace(table, columns={**table.columns, **{name: table.column(name) + wave for name in ("vx_v", "vy_v")}})


def test_a_users_own_effects_are_asked_for_and_sent_to_the_workers(
    cluster: LocalCluster, tmp_path: Path, rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RIG_HOME", str(tmp_path / "home"))
    effects, data = tmp_path / "effects", tmp_path / "data"
    effects.mkdir()
    data.mkdir()
    (effects / "ripple.py").write_text(RIPPLE)
    bench = tmp_path / "bench.yaml"
    bench.write_text("name: a bench\ninstruments: {}\nsensor: {name: S}\nfolders: {effects: effects}\n")
    for k in range(8):
        write_csv(rippled(k), data / f"{k}.csv")
    common = (str(data), "--scheduler", cluster.scheduler_address, "--json")
    guide = str(tmp_path / "guide")
    found = rig("fleet", "discover", *common, "--bench", str(bench), "--out", guide)
    assert [e["effect"] for e in found.document["batches"][0]["effects"]] == ["ripple"]
    assert found.err.count("are run") <= 1
    ended = rig("fleet", "calibrate", *common, "--bench", str(bench), "--model", guide,
                "--report", str(tmp_path / "page.html"))  # fmt: skip
    waves = {n["name"]: n["mean"] for n in ended.document["batches"][0]["population"] if n["effect"] == "ripple"}
    assert waves == {"wave": pytest.approx(5e-5, rel=0.1)}
    assert rig("fleet", "calibrate", *common, "--model", guide).status == 2


def asked(table: Table, model: str, tmp_path: Path, what: Any = "look") -> dict[str, Any]:
    """What a worker answers of a table."""
    path = tmp_path / "S.csv"
    write_csv(table, path)
    ((_, said),) = answer([Task("key", "S.csv", Question(what, dump_model(read_model(model))), text=path.read_text())])
    return said


@pytest.mark.parametrize(
    ("table", "model"), [(turned.ferraris, "gyroscope"), (lambda: turned.sap6(turned.DEVICES[0]), "field")]
)
def test_rates_and_positions_are_looked_at_and_diagnosed(
    table: Callable[[], Table], model: str, tmp_path: Path
) -> None:
    said = asked(table(), model, tmp_path)
    assert "fault" not in said
    assert said["chance"] < 0.05
    assert not said["stage"]["names"]
    assert asked(table(), model, tmp_path, "diagnosis")["effects"]


def test_positions_and_rates_have_no_common_columns(tmp_path: Path) -> None:
    """Two gyroscopes on one program of rates, one of them leaning: each has its own statistics."""
    first, table = turned.gyroscope(1), turned.gyroscope(2, lean_deg=2.0)
    model, effects = read_model("gyroscope"), catalogue()
    shared = SharedDesigns(effects)
    screen_sensor(first, model, shared)
    found, fitted = screen_sensor(table, model, shared), fit(model, table)
    own = {c.name: Screen(fitted).statistic(c.basis) for c in candidates(fitted, effects)}
    statistics = {name: max(s.statistic for s in found.scores if s.effect == name) for name in own}
    assert statistics == pytest.approx(own, rel=1e-6, abs=1e-3)


def test_a_table_that_a_fleet_cannot_judge_gets_a_command_that_can(golden, tmp_path: Path) -> None:
    still = Table.from_columns("still", {"t_s": np.arange(9.0), "vx_v": np.arange(9.0)}, source="S.csv")
    for table in (still, turned.ferraris()):
        golden.same(asked(table, "linear", tmp_path)["fault"])


class Told:
    """A fleet whose sensors miss `of[effects]` beside those effects: names with how strongly; and what was asked."""

    def __init__(self, of: dict[tuple[str, ...], dict[str, float]]) -> None:
        self.of, self.asked, self.steps = of, set[tuple[str, ...]](), list[str]()
        self.bare = screen_sensor(sensor(1), read_model("linear"), SharedDesigns({}))

    def ask(self, asked: Sequence[tuple[Member, Question]], step: str) -> Iterator[tuple[Member, Any]]:
        self.steps += [step] if asked else []
        for member, question in asked:
            self.asked.add(question.effects)
            yield member, write_look(self._look(int(member.sensor), question.effects))

    def _look(self, seed: int, effects: tuple[str, ...]) -> Screening:
        rng = np.random.default_rng([seed, len(effects)])
        strong = self.of.get(effects, {})
        scores = tuple(
            Score(name, 0, s, np.eye(2), float(s @ s), 2, 1.0)
            for name in ("first", "second", "third")
            if name not in effects
            for s in [strong.get(name, 0.0) + rng.standard_normal(2)]
        )
        return replace(self.bare, scores=scores, outliers=(), chance=1.0, excess=1.0)


MEMBERS = [Member(str(k), "lot", "", f"{k}.csv") for k in range(12)]
STEP = "a step"
START = Question("look", dump_model(read_model("linear")))


def effects_found(of: dict[tuple[str, ...], dict[str, float]]) -> tuple[list[str], Told]:
    told = Told(of)
    (batch,) = discover_fleet(told, MEMBERS, START).batches
    return [each.effect for each in batch.effects], told


def test_an_effect_that_others_make_needless_is_dropped() -> None:
    """The first looks like the two that are there, and goes once both are found."""
    both = {"second": 30.0, "third": 20.0}
    found, told = effects_found({
        (): {"first": 50.0, **both}, ("first",): both, ("first", "second"): {"third": 20.0},
        ("first", "third"): {"second": 20.0}, ("second",): {"third": 20.0}, ("third",): {"second": 20.0},
    })  # fmt: skip
    assert found == ["second", "third"]
    assert ("second", "third") in told.asked


def test_effects_that_are_all_needed_remain() -> None:
    found, told = effects_found({(): {"first": 50.0, "second": 20.0}, ("first",): {"second": 20.0},
                                 ("second",): {"first": 40.0}})  # fmt: skip
    assert found == ["first", "second"]
    assert told.steps == [
        "searching for missing effects, round 1",
        "searching for missing effects, round 2",
        "searching for missing effects, round 3",
        "batch lot: testing the need of first",
        "batch lot: testing the need of second",
    ]


def test_answers_in_the_record_are_read_in_slices(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked_for: list[int] = []

    def kept(_record: Record, keys: Sequence[str]) -> dict[str, Any]:
        asked_for.append(len(keys))
        return {key: {"fault": ""} for key in keys}

    monkeypatch.setattr(asked_module, "kept", kept)
    told: list[tuple[str, int, int]] = []
    fleet = Fleet(None, None, lambda *step: told.append(step))
    answers = fleet.ask([(replace(m, digest=str(k)), START) for k, m in enumerate(MEMBERS * 50)], STEP)
    next(answers)
    assert asked_for == [asked_module.SLICE]
    assert told == [(STEP, 0, 600)]  # what the record knows takes no time
    assert sum(1 for _ in answers) == 599


def test_the_page_shows_no_completion_during_the_work() -> None:
    assert progress_text("fitting the sensors", 3, 4) == "Fitting the sensors: 3 of 4 sensors"
    assert progress_text("fitting the sensors", 4, 4) == "Fitting the sensors: evaluating the answers"


def test_copies_of_a_table_are_computed_once_and_each_gets_the_answer(cluster: LocalCluster, tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_csv(sensor(1), tmp_path / f"{name}.csv")
    one, two = fleet_of([str(tmp_path)])
    assert one.digest == two.digest
    with Client(cluster) as client, Record(tmp_path) as record:
        said = dict(Fleet(client, record, lambda *_: None).ask([(one, START), (two, START)], STEP))
    assert said[one] == said[two]
    assert "fault" not in said[one]
