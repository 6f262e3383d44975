"""A residual as small as noise proves nothing where the data do not determine the model."""

import numpy as np
import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.determined import explain_undetermined, leverages, unseen_variance
from calibrations.fitting.fit import fit
from calibrations.loop import dataset, diagnose, discover
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.presentation.report.report import summary
from calibrations.table import Table
from tests.calibrations.test_real_data import mikoff, suarez, xsens


def nine() -> Model:
    return read_model("linear").with_effect(catalogue()["axis-nonorthogonality"])


def turned(betas: list[float], seed: int) -> Table:
    """An ideal axis at alpha = 90 deg, its means with white noise of 50 uV."""
    beta = np.array(betas)
    v = 2.5 + np.cos(np.radians(beta)) + np.random.default_rng(seed).normal(0, 5e-5, len(beta))
    columns = {"alpha_deg": np.full(len(beta), 90.0), "beta_deg": beta, "vx_v": v}
    noise = {"vx_std_v": np.full(len(beta), 5e-5), "n": np.ones(len(beta))}
    return Table.from_columns("poses", columns | noise)


def test_the_variance_on_an_unseen_row_is_that_of_leaving_it_out() -> None:
    betas = [0.0, 40.0, 100.0, 180.0, 270.0]
    errors = []
    for seed in range(300):
        table = turned(betas, seed)
        for k in range(len(betas)):
            seen = np.arange(len(betas)) != k
            cos = np.cos(np.radians(table.column("beta_deg")))
            scale, bias = np.polyfit(cos[seen], table.column("vx_v")[seen], 1)
            errors.append(table.column("vx_v")[k] - bias - scale * cos[k])
    found = unseen_variance(leverages(fit(read_model("linear"), turned(betas, 0))))
    assert found == pytest.approx(np.var(errors) / 5e-5**2, rel=0.1)


def test_many_rows_determine_a_model_and_few_do_not() -> None:
    assert explain_undetermined(fit(read_model("linear"), turned(list(range(0, 360, 10)), 1))) is None
    few = explain_undetermined(fit(read_model("linear"), turned([0.0, 10.0, 20.0], 1)))
    assert few is not None
    assert few.startswith(
        "the 3 rows determine the 2 parameters and cannot check them: the prediction of another one is "
    )


def test_a_parameter_that_one_row_alone_tells_is_known_and_unchecked() -> None:
    """A session as of six rests and a turn about each edge: 27 values, of which three pass through the fit."""
    rates, axes = np.array([*[0.0] * 6, 60.0, 50.0, 70.0]), np.tile(np.eye(3), (3, 1))
    outputs = 16 * rates[:, None] * axes + np.random.default_rng(2).normal(0, 0.1, (9, 3)) + [2.0, -4.0, -3.0]
    columns = {f"axis_{axis}": axes[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"g{axis}": outputs[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"g{axis}_std": np.full(9, 1.0) for axis in "xyz"}
    table = Table.from_columns("rates", columns | {"rate_deg_s": rates, "n": np.full(9, 100.0)})
    found = fit(read_model("gyroscope"), table)
    told = explain_undetermined(found)
    assert told is not None
    assert "the fit cannot check all of the 6 parameters: 3 of the 27 measured values (row 6, row 7, row 8)" in told
    assert "not identifiable" not in told
    assert leverages(found).sum() == pytest.approx(6)
    again = explain_undetermined(fit(read_model("gyroscope"), table.rows(np.array([*range(9), 6, 7, 8]))))
    assert again is None


def test_published_sets_of_many_positions_determine_nine_parameters() -> None:
    assert [explain_undetermined(fit(nine(), table)) for table in (xsens(), mikoff())] == [None, None]


@pytest.mark.parametrize(
    ("model", "reason"),
    [(nine(), "not identifiable from 10 positions"), (read_model("linear"), "determine the 6 parameters and cannot")],
)
def test_on_ten_positions_a_small_residual_is_not_reported_as_good(model: Model, reason: str) -> None:
    found = diagnose(suarez(), model)
    assert found.verdict == "ambiguous"
    assert reason in str(found.caution)
    assert found.next_experiment is None


def test_a_discovery_on_ten_positions_says_so_too() -> None:
    found = discover(suarez(), read_model("common-scale"))
    assert (found.verdict, found.causes) == ("ambiguous", ("scale-factor",))
    assert "the 10 positions determine the 6 parameters and cannot check them: " in str(found.caution)


def test_adding_an_effect_on_ten_positions_says_so_too() -> None:
    found = dataset(suarez()).add(catalogue()["axis-nonorthogonality"], read_model("linear"), catalogue())
    assert found.end.pooled_excess < 0.1
    assert found.verdict == "ambiguous"
    assert "the 9 parameters are not identifiable from 10 positions" in str(found.caution)


def test_eight_positions_that_cannot_show_a_place_have_a_result() -> None:
    """The search for places frees nine parameters."""
    found = discover(suarez().rows(np.arange(8)), read_model("common-scale"))
    assert found.verdict == "ambiguous"
    assert "the 8 positions determine the 4 parameters" in str(found.caution)


def test_a_report_on_ten_positions_says_so_too() -> None:
    found = discover(suarez(), nine())
    assert not found.steps
    assert found.judgement.headline.startswith("No effect is significant, but the ")
    assert "not identifiable from 10 positions" in summary(found)
