"""Each effect's parameters come back from data made by formulas written out here, within four standard errors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import norm

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic

Columns = dict[str, Array]
K = np.array([1.02, 0.98])  # V/g of x and y
B = np.array([2.51, 2.48])  # V
MADE: dict[str, Made] = {}


@dataclass(frozen=True)
class Made:
    """Outputs of x and y, shape (2, n), and the values that made them."""

    outputs: Callable[[Columns, Array], Array]
    truth: dict[tuple[str, str], float]


def made(name: str, **truth: float) -> Callable[[Callable[[Columns, Array], Array]], None]:
    """Register the maker of one effect's data; a key is `parameter` or `parameter_axis`."""

    def register(outputs: Callable[[Columns, Array], Array]) -> None:
        keys = {tuple(key.split("__")) if "__" in key else (key, ""): value for key, value in truth.items()}
        MADE[name] = Made(outputs, keys)

    return register


def linear(a: Array) -> Array:
    return K[:, None] * a[:2] + B[:, None]


@made("bias", bias__x=2.51, bias__y=2.48)
def _bias(columns: Columns, a: Array) -> Array:
    return linear(a)


@made("scale-factor", scale__x=1.02, scale__y=0.98)
def _scale_factor(columns: Columns, a: Array) -> Array:
    return linear(a)


@made("quadratic-nonlinearity", square__x=0.004, square__y=-0.002)
def _quadratic(columns: Columns, a: Array) -> Array:
    return linear(a) + np.array([0.004 * a[0] * a[0], -0.002 * a[1] * a[1]])


@made("cross-axis-bias", square__x=0.003, square__y=0.005)
def _cross_axis(columns: Columns, a: Array) -> Array:
    return linear(a) + np.array([0.003 * a[1] * a[1], 0.005 * a[0] * a[0]])


@made("z-axis-bias", square__x=0.03, square__y=-0.01)
def _z_bias(columns: Columns, a: Array) -> Array:
    return linear(a) + np.array([0.03, -0.01])[:, None] * a[2] * a[2]


@made("z-axis-scale", slope__x=0.004, slope__y=-0.003, square__x=0.02, square__y=0.01)
def _z_scale(columns: Columns, a: Array) -> Array:
    growth = np.array([0.004 * a[2] + 0.02 * a[2] ** 2, -0.003 * a[2] + 0.01 * a[2] ** 2])
    return linear(a) + growth * a[:2]


@made("axis-misalignment", x=0.3, y=-0.7, z=0.5)
def _misalignment(columns: Columns, a: Array) -> Array:
    axes = Rotation.from_rotvec([0.3, -0.7, 0.5], degrees=True).as_matrix().T  # rows: sensing axes, turned as a whole
    return linear(axes @ a)


@made("axis-nonorthogonality", xy=0.4)
def _nonorthogonality(columns: Columns, a: Array) -> Array:
    lean = np.radians(0.4)
    return linear(np.array([a[0], np.cos(lean) * a[1] + np.sin(lean) * a[0]]))


@made("temperature-bias", slope__x=0.0011, slope__y=-0.0006)
def _temperature(columns: Columns, a: Array) -> Array:
    warmer = columns["temperature_c"] - columns["temperature_c"].mean()
    return linear(a) + np.array([0.0011, -0.0006])[:, None] * warmer


@made("cubic-nonlinearity", cube__x=0.003, cube__y=-0.002)
def _cubic(columns: Columns, a: Array) -> Array:
    return linear(a) + np.array([0.003 * a[0] * a[0] * a[0], -0.002 * a[1] * a[1] * a[1]])


@made("odd-quadratic-nonlinearity", square__x=0.003, square__y=-0.002)
def _odd_quadratic(columns: Columns, a: Array) -> Array:
    return linear(a) + np.array([0.003 * np.sign(a[0]) * a[0] ** 2, -0.002 * np.sign(a[1]) * a[1] ** 2])


@made("scale-factor-asymmetry", kink__x=0.003, kink__y=-0.005, centre__x=0.03, centre__y=-0.02)
def _asymmetry(columns: Columns, a: Array) -> Array:
    kink, centre = np.array([0.003, -0.005]), np.array([0.03, -0.02])
    from_centre = a[:2] - centre[:, None]
    slopes = (K + kink)[:, None], (K - kink)[:, None]  # above the centre, below it
    return np.where(from_centre > 0, *slopes) * from_centre + (B + K * centre)[:, None]


@made("cross-axis-scale", slope__x=0.003, slope__y=0.004)
def _cross_axis_scale(columns: Columns, a: Array) -> Array:
    return linear(a) + np.array([0.003, 0.004])[:, None] * a[0] * a[1]


@made("temperature-scale", slope__x=0.0008, slope__y=-0.0005)
def _temperature_scale(columns: Columns, a: Array) -> Array:
    warmer = columns["temperature_c"] - columns["temperature_c"].mean()
    return linear(a) + np.array([0.0008, -0.0005])[:, None] * warmer * a[:2]


@made("base-tilt", x=0.2, y=-0.3)
def _base_tilt(columns: Columns, a: Array) -> Array:
    """The vertical leans; then the stages turn it: first alpha about y, then beta about z."""
    up = Rotation.from_rotvec([0.2, -0.3, 0.0], degrees=True).apply([0.0, 0.0, 1.0])
    turned = Rotation.from_euler("yz", np.column_stack([columns["alpha_deg"], columns["beta_deg"]]), degrees=True)
    return linear(turned.apply(up).T)


@made("stage-zero-offset", alpha=0.15, beta=-0.25)
def _zero_offset(columns: Columns, a: Array) -> Array:
    return linear(np.array(synthetic.components(moved(columns, alpha=0.15, beta=-0.25))))


@made("stage-eccentricity", sine=0.2, cosine=-0.1)
def _eccentricity(columns: Columns, a: Array) -> Array:
    beta = np.radians(columns["beta_deg"])
    return linear(np.array(synthetic.components(moved(columns, beta=0.2 * np.sin(beta) - 0.1 * np.cos(beta)))))


@made("stage-backlash", half_play=0.1)
def _backlash(columns: Columns, a: Array) -> Array:
    side, before, lag = 0.0, columns["beta_deg"][0], []
    for beta in columns["beta_deg"]:
        side = np.sign(beta - before) or side  # a pose that is held keeps the side of the last move
        before = beta
        lag.append(0.1 * side)
    return linear(np.array(synthetic.components(moved(columns, beta=-np.array(lag)))))


def moved(columns: Columns, alpha: Array | float = 0.0, beta: Array | float = 0.0) -> Columns:
    """The same poses with other true angles."""
    return columns | {"alpha_deg": columns["alpha_deg"] + alpha, "beta_deg": columns["beta_deg"] + beta}


@made("supply-sensitivity", share__x=0.9, share__y=1.1)
def _supply(columns: Columns, a: Array) -> Array:
    relative = columns["supply_v"] / columns["supply_v"].mean() - 1
    return linear(a) * (1 + np.array([0.9, 1.1])[:, None] * relative)


@made(
    "hysteresis",
    height__x=0.012,
    height__y=0.008,
    reach__x=0.15,
    reach__y=0.1,
    spread=0.5,
    pressing=0.0,
    pressing_square=0.0,
)
def _hysteresis(columns: Columns, a: Array) -> Array:
    return linear(a) + np.array([0.012, 0.008])[:, None] * hysteretic(columns, reach=(0.15, 0.1), spread=0.5)


def hysteretic(columns: Columns, reach: float | tuple[float, float], spread: float) -> Array:
    """Force in springs with sliders, dragged along the whole way from pose to pose; 1 where all slide; shape (2, n)."""
    limits = np.reshape(reach, (-1, 1)) * np.broadcast_to(1 + spread * np.array([-5, -3, -1, 1, 3, 5]) / 6, (2, 6))
    held, last = np.zeros((2, 6)), np.zeros(2)
    found = []
    for way in _ways(columns):
        for here in way:
            held = np.clip(held + (here - last)[:, None], -limits, limits)
            last = here
        found.append(held.sum(axis=1) / limits.sum(axis=1))
    return np.transpose(found)


def _ways(columns: Columns) -> Iterator[Array]:
    """x and y on the way to each pose, finely: alpha first, then beta; from home, alpha = 0."""
    before = 0.0, columns["beta_deg"][0]
    for alpha, beta in zip(columns["alpha_deg"], columns["beta_deg"], strict=True):
        u = np.linspace(0, 1, 200)
        alphas = np.radians(np.concatenate([before[0] + u * (alpha - before[0]), np.full(200, alpha)]))
        betas = np.radians(np.concatenate([np.full(200, before[1]), before[1] + u * (beta - before[1])]))
        yield np.column_stack([np.sin(alphas) * np.cos(betas), np.sin(alphas) * np.sin(betas)])
        before = alpha, beta


@made("dead-zone", width__x=0.02, width__y=0.05, centre__x=-0.01, centre__y=0.02)
def _dead_zone(columns: Columns, a: Array) -> Array:
    width, centre = np.array([[0.02], [0.05]]), np.array([[-0.01], [0.02]])
    from_centre = a[:2] - centre
    return linear(centre + np.sign(from_centre) * np.maximum(np.abs(from_centre) - width, 0.0))


@made("saturation", high__x=3.3, high__y=3.25, low__x=1.7, low__y=1.8, loss=1.0, knee=0.02)
def _saturation(columns: Columns, a: Array) -> Array:
    q = (np.arange(2000) + 0.5) / 2000
    shifts = 0.02 * np.log(q / (1 - q))  # the levels of 2000 parts of the amplifier, spread about their mean
    low, high = np.array([1.7, 1.8])[:, None, None], np.array([3.3, 3.25])[:, None, None]
    return np.asarray(np.mean(np.clip(linear(a)[..., None], low + shifts, high + shifts), axis=-1))


@made("warm-up-bias", amplitude__x=0.004, amplitude__y=-0.003, time_constant=300.0)
def _warm_up_bias(columns: Columns, a: Array) -> Array:
    left = np.exp(-(columns["t_s"] - columns["t_s"][0]) / 300.0)
    return linear(a) + np.array([0.004, -0.003])[:, None] * left


@made("warm-up-scale", amplitude__x=0.004, amplitude__y=-0.003, time_constant=500.0)
def _warm_up_scale(columns: Columns, a: Array) -> Array:
    left = np.exp(-(columns["t_s"] - columns["t_s"][0]) / 500.0)
    return linear(a) + np.array([0.004, -0.003])[:, None] * left * a[:2]


@made("bias-drift", slope__x=0.002, slope__y=-0.001)
def _bias_drift(columns: Columns, a: Array) -> Array:
    hours = (columns["t_s"] - columns["t_s"].mean()) / 3600
    return linear(a) + np.array([0.002, -0.001])[:, None] * hours


@made("adc-nonlinearity", bow=0.003, bend=0.002)
def _adc(columns: Columns, a: Array) -> Array:
    """Ends of the range are taken from the data, which this bends a little: hence the small coefficients."""
    v = linear(a)
    u = (v - (v.min() + v.max()) / 2) / (np.ptp(v) / 2)
    return v + 0.003 * u**2 + 0.002 * u**3


@made("temperature-hysteresis", slope__x=0.002, slope__y=-0.001, play=0.8)
def _temperature_hysteresis(columns: Columns, a: Array) -> Array:
    held, lagging = columns["temperature_c"][0], []
    for c in columns["temperature_c"]:
        held = np.clip(held, c - 0.8, c + 0.8)
        lagging.append(held)
    lag = np.array(lagging) - columns["temperature_c"].mean()
    return linear(a) + np.array([0.002, -0.001])[:, None] * lag


@made(
    "quantisation",
    step__x=0.02, step__y=0.02, offset__x=0.005, offset__y=-0.003, noise__x=0.004, noise__y=0.004,
)  # fmt: skip
def _quantisation(columns: Columns, a: Array) -> Array:
    """The mean of codes, each as likely as normal noise makes it; behind the converter each axis has its own offset."""
    codes = np.array([0.005, -0.003])[:, None] + 0.02 * np.arange(-20, 260)[:, None, None]
    reached = norm.cdf((codes + 0.01 - linear(a)) / 0.004) - norm.cdf((codes - 0.01 - linear(a)) / 0.004)
    return np.asarray(np.sum(codes * reached, axis=0))


@pytest.mark.parametrize("name", MADE)
def test_a_fit_recovers_the_parameters_of_an_effect(name: str) -> None:
    columns = synthetic.turns((90, 30, 150, 60, 120), step_deg=10)
    columns["temperature_c"] = 22 + 3 * np.sin(columns["t_s"] / 400)
    columns["supply_v"] = 5 + 0.01 * np.sin(columns["t_s"] / 300)
    outputs = MADE[name].outputs(columns, np.array(synthetic.components(columns)))
    table = synthetic.poses(columns, *outputs, seed=7)
    model = read_model("linear")
    found = fit(model if model.holds(name) else model.with_effect(catalogue()[name]), table)
    assert found.pooled_excess == pytest.approx(1.0, abs=0.1)
    estimates = {(e.name, e.axis): e for term in found.model.terms if term.name == name for e in term.estimates}
    assert {key for key in estimates if key[0] != "begin"} == set(MADE[name].truth)  # tests of `begin` are its own
    for key, value in MADE[name].truth.items():
        assert estimates[key].identified, key
        assert abs(estimates[key].value - value) < 4 * estimates[key].std, key


def test_a_triad_of_unknown_orientation() -> None:
    """Positions: bias, scales and the three departures from right angles, from |a| = 1 g alone."""
    a = Rotation.random(80, rng=np.random.default_rng(1)).as_matrix()[:, 0]
    s = np.sin(np.radians([0.5, -0.8, 0.3]))
    y = s[0] * a[:, 0] + np.sqrt(1 - s[0] ** 2) * a[:, 1]
    z = s[1] * a[:, 0] + s[2] * a[:, 1] + np.sqrt(1 - s[1] ** 2 - s[2] ** 2) * a[:, 2]
    noise = 1e-4 * np.random.default_rng(2).standard_normal((3, 80))
    v = np.array([0.1 + 1.01 * a[:, 0], -0.2 + 0.99 * y, 0.3 + 1.02 * z]) + noise
    std = {f"{k}_std": np.full(80, 1e-3) for k in ("ax", "ay", "az")}
    table = Table.from_columns("positions", {"ax": v[0], "ay": v[1], "az": v[2], **std, "n": np.full(80, 100.0)})
    found = fit(read_model("linear").with_effect(catalogue()["axis-nonorthogonality"]), table)
    values = {(e.name, e.axis): e for term in found.model.terms for e in term.estimates}
    truth = {("bias", "x"): 0.1, ("scale", "z"): 1.02, ("xy", ""): 0.5, ("xz", ""): -0.8, ("yz", ""): 0.3}
    for key, value in truth.items():
        assert abs(values[key].value - value) < 4 * values[key].std, key
