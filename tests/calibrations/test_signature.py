"""Signatures: what the linear model leaves of an effect, by arithmetic done again here."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.presentation.charts.signature import signature


def test_a_square_leaves_a_parabola_over_the_own_force() -> None:
    x, y = signature(catalogue()["quadratic-nonlinearity"])
    assert (x.label, y.label) == ("specific force along x (g)", "specific force along y (g)")
    for panel, square in ((x, 0.02), (y, 0.012)):
        rise = np.ptp(panel.residual[np.isclose(panel.abscissa, 0.0, atol=1e-9) | np.isclose(panel.abscissa, 1.0)])
        assert rise == pytest.approx(1e3 * square, rel=0.03)


def test_what_follows_another_axis_time_or_temperature_is_drawn_over_it() -> None:
    over = {name: signature(catalogue()[name])[0].label for name, e in catalogue().items() if e.kinds != ("still",)}
    assert over["cross-axis-bias"] == "specific force along y (g)"
    assert over["warm-up-bias"] == over["bias-drift"] == "time (min)"
    assert over["temperature-scale"] == "temperature (°C)"
    assert over["supply-sensitivity"] == "supply voltage (V)"
    assert over["hysteresis"] == over["base-tilt"] == "β (deg)"
    assert over["output-filter"] == over["vibration-rectification"] == "time (s)"


def test_only_axes_that_the_effect_reaches_are_drawn() -> None:
    assert [panel.axis for panel in signature(catalogue()["axis-nonorthogonality"])] == ["y"]
    assert [panel.axis for panel in signature(catalogue()["output-filter"])] == ["x"]


def test_both_directions_are_drawn_where_they_differ() -> None:
    styles = {name: {c.style for c in signature(catalogue()[name])[0].curves} for name in ("hysteresis", "base-tilt")}
    assert styles == {"hysteresis": {"-", "--"}, "base-tilt": {"-"}}
    loop = signature(catalogue()["hysteresis"])[0]
    up, down = (np.concatenate([c.rows for c in loop.curves if c.style == style]) for style in ("-", "--"))
    assert np.corrcoef(loop.residual[up], loop.residual[down][::-1])[0, 1] < 0  # opposite branches


def test_bias_and_scale_factor_are_shown_beside_a_model_without_them() -> None:
    assert signature(catalogue()["bias"])[0].residual == pytest.approx(20.0)
    panel = signature(catalogue()["scale-factor"])[0]
    assert panel.residual == pytest.approx(20.0 * panel.abscissa, abs=0.5)
