"""Results in words for a terminal: numbers to the digits that their uncertainty leaves them."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.discovery.rows import Rows
from calibrations.fitting.fit import fit
from calibrations.model.file import read_model
from calibrations.table import Table
from calibrations.text import concise
from tests.calibrations.test_pictures import warm_table


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (2.50012345, 4.5e-5, "2.500123(45) V"),
        (1.0030023, 9.98e-6, "1.003002(10) V"),  # rounded, the uncertainty is 0.000010
        (1.0030023, 9.94e-6, "1.0030023(99) V"),
        (12.3456, 0.996, "12.3(10) V"),
        (2.5, None, "2.5 V"),
    ],
)
def test_an_uncertainty_has_two_digits(value: float, std: float | None, text: str) -> None:
    assert concise(value, std, "V") == text


def test_a_residual_below_the_noise_is_doubted() -> None:
    table = warm_table()
    single = Table.from_columns("poses", {**table.columns, "n": np.ones(table.n)}, source="single samples")
    assert Rows(table).remarks(fit(read_model("linear"), table)) == []
    (remark,) = Rows(single).remarks(fit(read_model("linear"), single))
    assert remark.startswith("The error is smaller than the noise floor")
