"""The additions of a search, one at a time: which are taken, and the fits that show the falling error."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from calibrations.discovery.additions import NO_WORSE, Addition, fit_gradually, fit_together
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, fit
from calibrations.model.file import read_model
from tests.calibrations import synthetic

ADDED = [Addition(catalogue()[name]) for name in ("cubic-nonlinearity", "z-axis-bias")]


@pytest.fixture(scope="module")
def base() -> Fit:
    """The linear model on a sweep of a sensor with a cubic response and one to the square of z."""
    columns = synthetic.turns()
    forces = np.column_stack(synthetic.components(columns))
    outputs = 2.5 + forces[:, :2] + 2e-3 * forces[:, :2] ** 3 + 1e-3 * forces[:, 2:] ** 2
    return fit(read_model("linear"), synthetic.poses(columns, outputs[:, 0], outputs[:, 1]))


def test_the_last_fit_is_that_of_all_where_it_is_known(base: Fit) -> None:
    end = fit_together(base, ADDED)
    taken, fits = fit_gradually(base, ADDED, end)
    assert [a.effect.name for a in taken] == ["cubic-nonlinearity", "z-axis-bias"]
    assert fits[-1] is end
    assert all(after.pooled_excess < NO_WORSE * before.pooled_excess for before, after in pairwise(fits))
    fitted_anew = fit_gradually(base, ADDED)[1]
    assert [f.pooled_excess for f in fits] == pytest.approx([f.pooled_excess for f in fitted_anew], rel=1e-3)


def test_a_fit_of_all_that_went_astray_is_not_taken(base: Fit) -> None:
    taken, fits = fit_gradually(base, ADDED, base)  # in place of a fit with the error of the model without additions
    assert [a.effect.name for a in taken] == ["cubic-nonlinearity"]
    assert fits[-1].pooled_excess < base.pooled_excess
