"""Results in words for a terminal: numbers to the digits that their uncertainty leaves them."""

from __future__ import annotations

import pytest

from calibrations.model import Estimate
from rig.cli.words import with_uncertainty


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
    assert with_uncertainty(Estimate("bias", "x", value, std, "V")) == text
