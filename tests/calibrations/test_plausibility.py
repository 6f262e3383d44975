"""Outputs that cannot be those of the sensor as stated: no response, two sensors, exchanged channels and angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from calibrations.criteria import MATERIAL, MOST_UNSEEN
from calibrations.discovery.plausibility import _stuck, doubt, findings, refusal
from calibrations.discovery.readings import zero_doubt
from calibrations.discovery.verdict import Verdict
from calibrations.documents import comparison_document, diagnosis_document, discovery_document, fit_document
from calibrations.effects.catalogue import catalogue
from calibrations.errors import UnusableData
from calibrations.fitting.fit import fit
from calibrations.loop import compare, dataset, diagnose, discover
from calibrations.model.file import read_model
from calibrations.presentation.certificate.results import figures
from calibrations.table import Array, Table
from tests.calibrations.synthetic import NOISE_V, components, turns


@dataclass(frozen=True)
class Data:
    """Angles in deg and outputs in V, with white noise."""

    alpha: Array
    beta: Array
    vx: Array
    vy: Array
    samples: bool = True

    def table(self) -> Table:
        base = {name: values for name, values in turns().items() if name in ("direction", "t_s")}
        noise = {"vx_std_v": NOISE_V * np.sqrt(500), "vy_std_v": NOISE_V * np.sqrt(500), "n": 500.0}
        known = {name: np.full(len(self.vx), value) for name, value in noise.items()} if self.samples else {}
        columns = {"alpha_deg": self.alpha, "beta_deg": self.beta, "vx_v": self.vx, "vy_v": self.vy, **base, **known}
        return Table.from_columns("poses", columns, source="made")


def healthy() -> Data:
    base = turns()
    ax, ay, _ = components(base)
    noise = NOISE_V * np.random.default_rng(5).standard_normal((2, len(ax)))
    return Data(base["alpha_deg"], base["beta_deg"], 2.5 + ax + noise[0], 2.5 + 1.02 * ay + noise[1])


def stuck(d: Data) -> Data:
    rows = np.random.default_rng(6).random(len(d.vx)) < 0.8
    return replace(d, vx=np.where(rows, 2.5, d.vx))


def two_sensors(d: Data) -> Data:
    offset = 0.02 * (np.arange(len(d.vx)) % 2)
    return replace(d, vx=d.vx + offset, vy=d.vy + offset)


def some_rows_of_another(d: Data) -> Data:
    offset = 0.02 * (np.random.default_rng(1).random(len(d.vx)) < 0.15)
    return replace(d, vx=d.vx + offset, vy=d.vy + offset)


def two_sensors_with_strong_effects(d: Data) -> Data:
    """Rows mixed at random, of sensors with the same cubic and hysteresis, ten times as large as their distance."""
    table = replace(d, samples=False).table()
    offset = 0.005 * (np.random.default_rng(2).random(len(d.vx)) < 0.5)
    x, y = d.vx - 2.5, d.vy - 2.5
    same = 0.02 * table.column("direction")
    return replace(d, vx=d.vx + 0.05 * x**3 + same + offset, vy=d.vy - 0.05 * y**2 * x + same + offset)


def two_scales(d: Data) -> Data:
    factor = 1 + 0.02 * (np.arange(len(d.vx)) % 2)
    return replace(d, vx=2.5 + (d.vx - 2.5) * factor, vy=2.5 + (d.vy - 2.5) * factor)


def jump(n: int) -> Array:
    """1 mV in the second half."""
    return 1e-3 * (np.arange(n) > n / 2)


DEAD: dict[str, tuple[Callable[[Data], Data], str]] = {
    "constant": (lambda d: replace(d, vx=0 * d.vx + 2.5), "vx_v is constant"),
    "noise": (
        lambda d: replace(d, vy=2.5 + NOISE_V * np.random.default_rng(7).standard_normal(len(d.vy))),
        "vy_v is only noise",
    ),
    "unplugged, with a jump in mid-run": (
        lambda d: replace(d, vx=2.4 + jump(len(d.vx)), vy=2.5 + 0.9 * jump(len(d.vx))),
        "vx_v does not follow the poses",
    ),
    "noise of unknown level": (
        lambda d: replace(d, vy=2.5 + np.random.default_rng(7).standard_normal(len(d.vy)), samples=False),
        "vy_v does not follow the poses",
    ),
    "stuck": (stuck, "vx_v is stuck at 2.5 V"),
    "shuffled": (lambda d: replace(d, vx=np.random.default_rng(8).permutation(d.vx)), "vx_v does not follow the poses"),
}
WRONG: dict[str, tuple[Callable[[Data], Data], str]] = {
    "two sensors": (two_sensors, "two groups of rows"),
    "two scale factors": (two_scales, "two groups of rows"),
    "some rows of another sensor": (some_rows_of_another, "two groups of rows"),
    "two sensors with strong effects": (two_sensors_with_strong_effects, "two groups of rows"),
    "two sensors, noise unknown": (lambda d: replace(two_sensors(d), samples=False), "differ by 20 mV"),
    "channels": (lambda d: replace(d, vx=d.vy, vy=d.vx), "the channels are exchanged"),
    "angles": (lambda d: replace(d, alpha=d.beta, beta=d.alpha), "alpha_deg and beta_deg are exchanged"),
    "horizontal": (lambda d: replace(d, alpha=90 - d.alpha), "alpha is counted from the horizontal"),
    "radians": (lambda d: replace(d, alpha=np.radians(d.alpha), beta=np.radians(d.beta)), "in radians"),
    "turned": (lambda d: replace(d, beta=d.beta - 40), "40 deg away"),
}
MIRRORED = {
    "beta backwards": lambda d: replace(d, beta=-d.beta),
    "turned by 180 deg": lambda d: replace(d, vx=5 - d.vx, vy=5 - d.vy),
}


def few_poses(seed: int = 5) -> Table:
    """Eight poses, each measured 38 times; the stages' angles err by up to 0.1 deg, at each pose the same."""
    alpha, beta = np.array([90, 60, 90, 120, 90, 30, 90, 150.0]), np.arange(0, 360, 45.0)
    order = np.concatenate([np.arange(8) if k % 2 == 0 else np.arange(8)[::-1] for k in range(38)])
    wrong = np.random.default_rng(1).choice([-0.1, 0.1], 8)
    columns = {"alpha_deg": alpha[order], "beta_deg": beta[order], "t_s": 10.0 * np.arange(len(order))}
    ax, ay, _ = components({**columns, "beta_deg": (beta + wrong)[order]})
    outputs = 2.5 + np.array([ax, ay]) + NOISE_V * np.random.default_rng(seed).standard_normal((2, len(order)))
    known = {name: np.full(len(order), NOISE_V * np.sqrt(500)) for name in ("vx_std_v", "vy_std_v")}
    samples = {"vx_v": outputs[0], "vy_v": outputs[1], **known, "n": np.full(len(order), 500.0)}
    return Table.from_columns("poses", columns | samples, source="made")


def test_an_error_of_each_pose_is_no_second_sensor() -> None:
    table = few_poses()
    assert findings(table) == ()
    mixed = table.with_outputs(table.outputs + 0.02 * (np.random.default_rng(3).random(table.n) < 0.5)[:, None])
    assert "two groups of rows" in findings(mixed)[0].text


def test_strong_effects_at_eight_headings_of_each_mount_are_no_second_sensor() -> None:
    """Products of the forces have few values there, so that they divide the rows into groups with nothing between."""
    headings, mounts = np.radians(np.arange(0.0, 360.0, 45.0)), np.radians([40.0, 90.0, 140.0])
    alpha, beta = (angle.ravel() for angle in np.meshgrid(mounts, headings, indexing="ij"))
    alpha, beta, flip = np.tile(alpha, 8), np.tile(beta, 8), np.repeat(np.arange(8) % 2, alpha.size)
    x, y = np.sin(alpha) * np.cos(beta), np.sin(alpha) * np.sin(beta) * (1 - 2 * flip)
    noise = 6e-5 * np.random.default_rng(3).standard_normal((2, len(x)))
    saturated = [np.clip(1.2 * a, -1.08, 1.08) for a in (x, y)]
    columns = {
        "alpha_deg": np.degrees(alpha), "beta_deg": np.degrees(beta), "flip": flip.astype(float),
        "t_s": 12.0 * np.arange(len(x)),
        "vx_v": saturated[0] + 3e-3 * x * y + noise[0], "vy_v": saturated[1] - 5e-3 * x * y + noise[1],
    }  # fmt: skip
    assert not any(
        "two groups" in found.text for found in findings(Table.from_columns("poses", columns, source="made"))
    )


def test_a_model_that_follows_a_few_poses_alone_says_so() -> None:
    found = discover(few_poses(), read_model("linear"), catalogue())
    assert found.end.pooled_excess < MATERIAL < MOST_UNSEEN < found.end.held_out_excess
    assert "these rows are at few poses: measure at more orientations" in str(found.residual_structure)
    assert found.verdict != Verdict.ADEQUATE


def test_healthy_data_get_no_finding() -> None:
    assert findings(healthy().table()) == ()
    assert findings(replace(healthy(), samples=False).table()) == ()


@pytest.mark.parametrize("name", DEAD)
def test_an_output_without_response(name: str) -> None:
    spoil, reason = DEAD[name]
    found = refusal(spoil(healthy()).table())
    assert found is not None
    assert (found.verdict, reason in found.text) == (Verdict.NO_RESPONSE, True), found.text


@pytest.mark.parametrize("name", WRONG)
def test_wrongly_assigned_channels_are_refused(name: str) -> None:
    spoil, reason = WRONG[name]
    found = refusal(spoil(healthy()).table())
    assert found is not None
    assert (found.verdict, reason in found.text) == (Verdict.UNEXPLAINED, True), found.text


@pytest.mark.parametrize("name", MIRRORED)
def test_a_mirrored_or_turned_sensor_is_a_warning_only(name: str) -> None:
    table = MIRRORED[name](healthy()).table()
    assert refusal(table) is None
    assert "is negative" in (doubt(table) or "")
    assert diagnose(table, read_model("linear")).verdict == "adequate"


def test_saturation_and_a_pattern_in_time_or_direction_are_effects() -> None:
    d = healthy()
    half = 0.02 * (np.arange(len(d.vx)) > len(d.vx) / 2)
    side = 0.01 * turns()["direction"]
    for spoiled in (
        replace(d, vx=np.minimum(d.vx, 3.0)),
        replace(d, vx=d.vx + half, vy=d.vy + half),
        replace(d, vx=d.vx + side, vy=d.vy + side),
    ):
        assert findings(spoiled.table()) == ()


def test_two_groups_of_rows_that_differ_in_direction_are_an_effect() -> None:
    table = two_sensors(healthy()).table()
    direction = np.where(np.arange(table.n) % 2, 1.0, -1.0)
    assert refusal(table) is not None
    assert findings(replace(table, columns={**table.columns, "direction": direction})) == ()


def test_two_groups_of_rows_that_differ_in_the_stage_angle_are_an_effect() -> None:
    """The poses are in a random order, so that the groups have no pattern in time."""
    d = healthy()
    offset = 0.02 * (np.floor(d.beta / 90) % 2)
    order = np.random.default_rng(3).permutation(len(d.vx))
    spoiled = Data(d.alpha[order], d.beta[order], (d.vx + offset)[order], (d.vy + offset)[order])
    assert findings(spoiled.table()) == ()


def test_an_effect_at_a_few_poses_of_a_soak_is_no_second_sensor() -> None:
    """Both groups are the same at the orientation of the soak, whose rows the noise divides between them."""
    alpha = np.r_[np.tile(90.0, 88), np.zeros(540)]
    beta = np.r_[np.tile([0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0], 11), np.zeros(540)]
    direction = np.r_[np.tile([1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0], 11), np.zeros(540)]
    ax, ay, _ = components({"alpha_deg": alpha, "beta_deg": beta})
    noise = NOISE_V * np.random.default_rng(8).standard_normal((2, 628))
    hysteresis = 0.005 * direction * np.array([np.abs(ay), np.abs(ax)])
    measured = {"vx_v": 2.5 + ax + hysteresis[0] + noise[0], "vy_v": 2.5 + ay + hysteresis[1] + noise[1]}
    spread = dict.fromkeys(("vx_std_v", "vy_std_v"), np.full(628, NOISE_V * np.sqrt(500)))
    columns = {"alpha_deg": alpha, "beta_deg": beta, "t_s": 10.0 * np.arange(628), "n": np.full(628, 500.0)}
    assert findings(Table.from_columns("poses", {**columns, **measured, **spread}, source="made")) == ()


@pytest.mark.parametrize("spoil", [DEAD["noise"][0], two_sensors])
def test_every_command_gives_the_same_verdict(spoil: Callable[[Data], Data]) -> None:
    table, model = spoil(healthy()).table(), read_model("linear")
    expected = refusal(table)
    assert expected is not None
    effect = catalogue()["cubic-nonlinearity"]
    documents = (
        fit_document(dataset(table), fit(model, table), None),
        comparison_document(compare(table, model), "linear"),
        diagnosis_document(diagnose(table, model), "linear"),
        discovery_document(discover(table, model), None),
        discovery_document(dataset(table).add(effect, model, catalogue()), None),
    )
    for document in documents:
        assert (document["verdict"], document["residual_structure"]) == (expected.verdict, expected.text)
    assert not compare(table, model).adequate
    with pytest.raises(UnusableData, match="no certificate"):
        figures(fit(model, table), None, {}, trials=10)


@pytest.mark.release
def test_scatter_beyond_the_samples_is_unexplained_everywhere() -> None:
    d = healthy()
    wild = 0.02 * np.random.default_rng(9).standard_normal((2, len(d.vx)))
    table = replace(d, vx=d.vx + wild[0], vy=d.vy + wild[1]).table()
    assert diagnose(table, read_model("linear")).verdict == "unexplained"
    with pytest.raises(UnusableData, match="scatter without a pattern"):
        figures(fit(read_model("linear"), table), None, {}, trials=10)


def test_no_stage_zero_is_off_by_tens_of_degrees() -> None:
    d = healthy()
    found = discover(replace(d, alpha=d.alpha - 30).table(), read_model("linear"))
    assert found.verdict == "unexplained"
    assert "the zero of alpha_deg is +30 deg off" in (found.residual_structure or "")
    assert "stage-zero-offset" not in found.causes


def test_a_stage_zero_that_is_off_by_some_degrees_is_named() -> None:
    d = healthy()
    doubt = zero_doubt(replace(d, alpha=d.alpha - 5.0).table(), residual_share=0.01)
    assert "if the zero of alpha_deg is +5 deg off;" in (doubt or "")
    assert zero_doubt(d.table(), residual_share=0.01) is None


def test_an_output_that_gravity_explains_in_no_row_is_not_stuck() -> None:
    random = np.random.default_rng(4)
    a = random.uniform(-1.0, 1.0, (200, 3))
    driven, unrelated = 2.5 + a[:, 0], 2.5 + random.standard_normal(200)
    driven[:60] = unrelated[:60] = 2.5
    assert "stuck at 2.5 V in 60 of 200 rows" in str(_stuck(driven, a, "vx_v"))
    assert _stuck(unrelated, a, "vx_v") is None
