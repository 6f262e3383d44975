"""What holds for every effect of the catalogue, also one that is added tomorrow."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibrations.effects import HOOKS, Effect, Parameter, Values
from calibrations.effects.catalogue import catalogue, find
from calibrations.errors import ModelError, UnknownName
from calibrations.fitting.fit import fit
from calibrations.fitting.problem_kinds import make_problem
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import shaken, synthetic, test_turns

NOISE = {name: effect for name, effect in catalogue().items() if effect.kinds == ("still",)}
SIGNAL = {name: effect for name, effect in catalogue().items() if name not in NOISE}
EFFECTS = pytest.mark.parametrize("effect", catalogue().values(), ids=catalogue())
EFFECTS_ON_SAMPLES = pytest.mark.parametrize("effect", SIGNAL.values(), ids=SIGNAL)


def table_for(effect: Effect, kind: str) -> Table:
    """A table with every column that the effect needs, all of them changing."""
    columns = synthetic.turns((90, 30, 150), step_deg=30)
    a = np.column_stack(synthetic.components(columns))
    needed = {name: np.linspace(4.9, 5.1, len(a)) for name in effect.needs if name not in columns}
    if kind == "poses":
        made = synthetic.poses(columns | needed, a[:, 0] + 2.5, a[:, 1] + 2.5)
        spread = np.linspace(1e-3, 5e-3, len(a))  # with vibration that changes
        return Table.from_columns("poses", {**made.columns, "vx_std_v": spread, "vy_std_v": spread}, made.constants)
    if kind == "motion":
        moved = shaken.record(duration_s=4.0, attitudes=((45.0, 60.0),))
        needed = {name: np.linspace(4.9, 5.1, moved.n) for name in effect.needs if name not in moved}
        return Table.from_columns("motion", {**moved.columns, **needed}, moved.constants)
    if kind == "rates":
        return _turned_at_rates(needed)
    if kind == "turns":
        moved = test_turns.table(test_turns.samples(noise=0.02))
        needed = {name: np.linspace(4.9, 5.1, moved.n) for name in effect.needs if name not in moved}
        return Table.from_columns("turns", {**moved.columns, **needed}, moved.constants)
    turned = Rotation.random(len(a), rng=np.random.default_rng(0)).as_matrix()[:, 0]
    needed |= {"t_s": columns["t_s"]}
    names = ("mx", "my", "mz") if kind == "fields" else ("ax", "ay", "az")
    return Table.from_columns("positions", dict(zip(names, turned.T, strict=True)) | needed)


def _turned_at_rates(needed: dict[str, Array]) -> Table:
    """Turns about each edge of the sensor, both ways, as it stands upright on a table."""
    up, rate = np.repeat(np.eye(3), 40, axis=0), np.tile(np.linspace(-90.0, 90.0, 40), 3)
    columns = {"rate_deg_s": rate, "t_s": np.arange(120.0)}
    columns |= dict(zip(("ax", "ay", "az"), up.T, strict=True))
    columns |= dict(zip(("gx", "gy", "gz"), 16.0 * (up * rate[:, None]).T, strict=True))
    return Table.from_columns("rates", columns | {k: np.resize(v, 120) for k, v in needed.items() if k not in columns})


# The models that an effect is added to, where not to `linear`.
STARTS = {"fields": "magnetometer", "rates": "gyroscope", "turns": "gyroscope"}


@EFFECTS_ON_SAMPLES
def test_every_parameter_changes_the_residual_smoothly(effect: Effect) -> None:
    for kind in effect.kinds:
        table = table_for(effect, kind)
        assert effect.excluded(table) is None
        model = fit(read_model(STARTS.get(kind, "linear")), table).model
        if kind == "motion":  # turned, so that y moves as well
            model = model.with_effect(catalogue()["axis-misalignment"])
        problem = make_problem(model.with_effect(effect), table)
        mine = problem.layout.of_effect(effect.name)
        assert mine.any()
        start = problem.layout.starts()[-1]
        jacobian = problem.jacobian(start + 0.01 * problem.layout.typical, mine)
        assert np.all(np.isfinite(problem.residual(start)))
        assert np.all(np.isfinite(jacobian))
        names = [slot.parameter.name for slot, own in zip(problem.layout.slots, mine, strict=True) if own]
        seen = jacobian.any(axis=(0, 1))
        assert {name for name, each in zip(names, seen, strict=True) if each} == set(names)  # of one axis at least


@EFFECTS_ON_SAMPLES
def test_an_effect_without_memory_follows_the_force_of_its_own_row(effect: Effect) -> None:
    kind = effect.kinds[0]
    problem = make_problem(read_model(STARTS.get(kind, "linear")).with_effect(effect), table_for(effect, kind))
    table, layout = problem.samples, problem.layout
    steps = dict(layout.steps(layout.starts()[-1] + 0.1 * layout.typical))
    a, moved = (np.random.default_rng(0).uniform(-1, 1, (table.n, 3)) for _ in range(2))
    moved[::2], moved[1::2] = a[::2], -a[1::2]
    before, after = (np.broadcast_to(effect.transduction(each, table, steps[effect]), a.shape) for each in (a, moved))
    assert np.array_equal(before[::2], after[::2]) or effect.memory


@EFFECTS
def test_says_what_a_person_should_know(effect: Effect) -> None:
    for text in (
        effect.summary,
        effect.formula,
        effect.symptom,
        effect.excited_by,
        effect.confused_with,
        effect.source,
    ):
        assert text
    assert effect.acts_on in HOOKS
    for parameter in effect.parameters:
        assert parameter.unit
        assert parameter.doc
        assert parameter.typical > 0
        assert all(parameter.low <= start <= parameter.high for start in parameter.starts)


@EFFECTS
def test_is_refused_where_its_columns_are_missing(effect: Effect) -> None:
    table = Table.from_columns("poses", {"alpha_deg": [90.0], "beta_deg": [0.0], "vx_v": [1.0]})
    without = not effect.needs and effect.name != "vibration-rectification"  # which needs standard deviations
    assert (effect.excluded(table) is None) == (without and "poses" in effect.kinds)
    still = effect.excluded(Table.from_columns("still", {"t_s": [0.0]}))
    assert still is None if effect.name in NOISE else "is not defined for still" in str(still)


def test_unknown_effect_names_the_nearest(golden) -> None:
    with golden.refused(UnknownName):
        find("hysteresys", catalogue())


OWN = '''from calibrations.effects import Constant, Effect, Parameter

class Sag(Effect):
    """sag: the output sags with time.

        V += s t

    Symptom   the residual follows time.
    """

    needs = ("t_s",)
    sag = Parameter("{out}/s", typical=1e-4)
    begin_s = Constant(lambda table: float(table.time_s[0]))

    def transduction(self, a, table, p):
        return (table.time_s - p.begin_s)[:, None] * p.sag

    def _helper(self):
        return 1
'''


def test_a_users_own_effect_is_one_file(tmp_path: Path) -> None:
    (tmp_path / "sag.py").write_text(OWN)
    effects = catalogue(tmp_path)
    assert set(effects) == {*catalogue(), "sag"}
    sag = effects["sag"]
    assert (sag.summary, sag.acts_on) == ("the output sags with time.", "transduction")
    assert [(p.name, p.unit) for p in sag.parameters] == [("sag", "{out}/s")]
    table = Table.from_columns("poses", {n: [1.0, 3.0] for n in ("alpha_deg", "beta_deg", "vx_v", "t_s")})
    p = Values.of({"sag": np.full(3, 0.5), "begin_s": sag.constants["begin_s"](table)})
    assert np.array_equal(sag.transduction(np.zeros((2, 3)), table, p), [[0.0] * 3, [1.0] * 3])


MISSPELT = [
    ("needs =", "need =", 'has no member "need"; did you mean "needs"'),
    ("def transduction", "def tranduction", 'has no member "tranduction"; did you mean "transduction"'),
    ('needs = ("t_s",)', 'needs = "t_s"', 'needs must be a tuple of names, as in ("temperature_c",)'),
    ('needs = ("t_s",)', 'kinds = ("pose",)', 'no kind of table "pose"; did you mean "poses"'),
    ('needs = ("t_s",)', 'exact = "no"', "exact is 'no'; it must be of type bool"),
    ('needs = ("t_s",)', 'after = ("bais",)', 'there is no effect "bais"; did you mean "bias"'),
    ('needs = ("t_s",)', "memory = 2", "memory and follow belong together"),
    ("(self, a, table, p)", "(a, table, p)", "transduction must be a method: def transduction(self, a, table, p)"),
    ("(self, a, table, p)", "(self, a, p)", "transduction must be a method: def transduction(self, a, table, p)"),
    ("typical=1e-4", "typical=1e-4, where='begin'", 'sag: the effect has no constant "begin"; did you mean "begin_s"'),
    ("typical=1e-4", "typical=0", "typical is 0; it must be a number above 0"),
    ("sag = Parameter", "force = Parameter", '"force" has a meaning of its own in an effect'),
    ("sag = Parameter", "items = Parameter", '"items" has a meaning of its own in an effect'),
    ("lambda table: float(table.time_s[0])", "3.0", "the constant begin_s needs a function of the table"),
    ("class Sag", "class Sagging", "must define one effect, `class Sag(Effect):`; it defines Sagging"),
]


@pytest.mark.parametrize(("right", "wrong", "says"), MISSPELT, ids=[wrong for _, wrong, _ in MISSPELT])
def test_a_wrong_member_is_refused_with_the_right_one(tmp_path: Path, right: str, wrong: str, says: str) -> None:
    assert right in OWN
    (tmp_path / "sag.py").write_text(OWN.replace(right, wrong))
    with pytest.raises(ModelError) as error:
        catalogue(tmp_path)
    assert says in str(error.value)


def test_a_misspelt_parameter_names_the_nearest() -> None:
    with pytest.raises(AttributeError, match='no parameter "slpoe"; did you mean "slope"'):
        Values(slope=np.zeros(3)).slpoe  # noqa: B018


def test_an_effect_defined_in_a_notebook_has_its_class_as_name() -> None:
    class FifthHarmonic(Effect):
        sine = Parameter("{out}", typical=0.1)
        cosine = Parameter("{out}", typical=0.1)

        def transduction(self, a: Array, table: Table, p: Values) -> Array:
            return a * p.sine

    effect = FifthHarmonic()
    assert (effect.name, [p.name for p in effect.parameters]) == ("fifth-harmonic", ["sine", "cosine"])


SHORT = OWN.replace("Sag(", "Wrong(").replace("sag: ", "wrong: ")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x = 1\n", r"must define one effect, `class Wrong\(Effect\):`; it defines no effect. See"),
        ("import nowhere_to_be_found\n", "ModuleNotFoundError: No module named"),
        ("def output(v, table, p):\n    return v\n", 'it defines no effect. See "An effect" in CONTRIBUTING.md'),
        (SHORT.replace("Symptom", "Sympton"), "the docstring of Wrong must begin with"),
        (SHORT.replace("wrong: the", "the"), "the docstring of Wrong must begin with"),
        (SHORT.replace("sag =", "_sag ="), "Wrong has no parameter"),
        (SHORT.replace("def transduction", "def _transduction"), "Wrong acts nowhere"),
    ],
)
def test_a_file_that_is_not_an_effect(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "wrong.py").write_text(text)
    with pytest.raises(ModelError, match=says) as error:
        catalogue(tmp_path)
    assert "wrong.py" in str(error.value)


def test_folder_of_own_effects_must_exist(golden, tmp_path: Path) -> None:
    with golden.refused(ModelError):
        catalogue(tmp_path / "nowhere")
