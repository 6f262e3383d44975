"""Written files against formulas: the sensor's equation, then the file's own, gives the input again.

Both equations are written here from the pages of the effects and from the documents of the formats, and share nothing
with the exporters. The error that an export states is that of its file.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from calibrations.compensation.inverse import Range, invert_model
from calibrations.exporting.autopilots import Slot
from calibrations.exporting.formats import export_model
from calibrations.exporting.noise_files import ExportSettings
from calibrations.exporting.simulated import ExportedFile
from calibrations.model import Model
from calibrations.table import Array
from tests.calibrations.compiled import COMPILERS, DRIVER, build, through, written
from tests.calibrations.fitted import Numbers, model

G = 9.80665
COLD, HOT = -10.0, 60.0
LINEAR: Mapping[str, Mapping[str, Numbers]] = {
    "bias": {"bias": (0.31, -0.22, 0.48)},
    "scale-factor": {"scale": (9.9, 9.71, 9.84)},
}
PARTS: Mapping[str, Mapping[str, Mapping[str, Numbers]]] = {
    "turned": {"axis-misalignment": {"x": 0.8, "y": -1.3, "z": 2.1}},
    "leaning": {"axis-nonorthogonality": {"xy": 0.4, "xz": -0.3, "yz": 0.2}},
    "bent": {
        "quadratic-nonlinearity": {"square": (0.05, -0.03, 0.02)},
        "cubic-nonlinearity": {"cube": (0.02, 0.04, 0)},
    },
    "warm": {"temperature-bias": {"slope": (4e-3, -2e-3, 7e-3)}},
    "drifting": {"temperature-scale": {"slope": (2e-3, 1e-3, -3e-3)}},
}
SENSORS = {
    "linear": LINEAR,
    **{name: {**LINEAR, **part} for name, part in PARTS.items()},
    "all": {**LINEAR, **{effect: values for part in PARTS.values() for effect, values in part.items()}},
}
RATE_BIAS = np.array([1.2, -0.9, 0.7])  # deg/s
PER_DEG_S = {"rad/s": np.pi / 180, "deg/s": 1.0}
NAMES = [pytest.param(name, marks=pytest.mark.slow) if name == "all" else name for name in SENSORS]
IN_FULL = ("linear", "turned", "leaning")  # a matrix and an offset hold these without a loss
IN_DIAGONAL = ("linear", "warm")  # an offset with a polynomial of the temperature, and a scale


def of(values: Mapping[str, Mapping[str, Numbers]], unit: str = "m/s^2") -> Model:
    return replace(model(values), unit=unit, covered={"temperature_c": (COLD, HOT)}, name="mine")


def forces(n: int, reach: float = 1.0, seed: int = 3) -> tuple[Array, Array]:
    """Specific forces of size `reach` in g (n, 3) from all sides, and temperatures (n,)."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, 3))
    return reach * a / np.linalg.norm(a, axis=1, keepdims=True), rng.uniform(COLD, HOT, n)


def rates(n: int) -> Array:
    """Rates in deg/s (n, 3)."""
    return np.random.default_rng(4).uniform(-170, 170, (n, 3))


def accelerometer(values: Mapping[str, Mapping[str, Numbers]], a: Array, t: Array) -> Array:
    """Outputs by the equations on the pages of the effects."""

    def of_axes(effect: str, name: str) -> Array:
        return np.array(values.get(effect, {}).get(name, (0.0, 0.0, 0.0)), dtype=float)

    turn = values.get("axis-misalignment", {})
    a = a @ Rotation.from_rotvec(np.radians([turn.get(axis, 0.0) for axis in "xyz"])).as_matrix()  # R^T a, as rows
    lean = values.get("axis-nonorthogonality", {})
    xy, xz, yz = np.sin(np.radians([lean.get(name, 0.0) for name in ("xy", "xz", "yz")]))
    sensing = [[1, 0, 0], [xy, np.sqrt(1 - xy**2), 0], [xz, yz, np.sqrt(1 - xz**2 - yz**2)]]
    a = a @ np.array(sensing).T
    scale = of_axes("scale-factor", "scale")
    response = (
        scale * a + of_axes("quadratic-nonlinearity", "square") * a**2 + of_axes("cubic-nonlinearity", "cube") * a**3
    )
    warmer = (t - 25.0)[:, None]
    drift = warmer * of_axes("temperature-scale", "slope") * response / scale
    return of_axes("bias", "bias") + response + warmer * of_axes("temperature-bias", "slope") + drift


def parameters(text: str) -> dict[str, float]:
    """Names and values: tab-separated for PX4, with a comma for ArduPilot."""
    rows = [line.split("\t")[2:4] if "\t" in line else line.split(",") for line in text.splitlines() if line[0] != "#"]
    return {name: float(value) for name, value in rows}


def xyz(found: Mapping[str, float], pattern: str, missing: float = 0.0) -> Array:
    return np.array([found.get(pattern.replace("*", axis), missing) for axis in "XYZ"])


def by_px4(text: str, x: Array, t: Array) -> Array:
    p = parameters(text)
    corrected = x - xyz(p, "CAL_ACC0_*OFF")
    if p.get("TC_A_ENABLE"):
        d = np.clip(t, p["TC_A0_TMIN"], p["TC_A0_TMAX"]) - p["TC_A0_TREF"]
        for order in range(4):
            corrected = corrected - np.outer(d**order, [p[f"TC_A0_X{order}_{i}"] for i in range(3)])
    return corrected * xyz(p, "CAL_ACC0_*SCALE")


def by_ardupilot(text: str, x: Array, t: Array) -> Array:
    p = parameters(text)
    if p.get("INS_TCAL1_ENABLE"):
        for at, sign in ((t, -1.0), (np.full(len(t), p["INS_ACC1_CALTEMP"]), 1.0)):
            d = np.clip(at, p["INS_TCAL1_TMIN"], p["INS_TCAL1_TMAX"]) - 35.0
            c1, c2, c3 = (1e-6 * xyz(p, f"INS_TCAL1_ACC{order}_*") for order in (1, 2, 3))
            x = x + sign * (np.outer(d, c1) + np.outer(d**2, c2) + np.outer(d**3, c3))
    return (x - xyz(p, "INS_ACCOFFS_*")) * xyz(p, "INS_ACCSCAL_*")


def by_imu_calib(text: str, x: Array, _: Array) -> Array:
    read = yaml.safe_load(text)
    sm = read["SM"]  # row by row
    rows = [sum(sm[3 * i + k] * x[:, k] for k in range(3)) - read["bias"][i] for i in range(3)]
    return np.column_stack(rows)


def by_imu_tk(text: str, x: Array, _: Array) -> Array:
    numbers = [float(word) for word in text.split()]
    turned, scaled, bias = (np.array(part) for part in (numbers[:9], numbers[9:18], numbers[18:]))
    return np.asarray([turned.reshape(3, 3) @ scaled.reshape(3, 3) @ (row - bias) for row in x])


FORMATS: Mapping[str, Callable[[str, Array, Array], Array]] = {
    "px4": by_px4,
    "ardupilot": by_ardupilot,
    "imu_calib": by_imu_calib,
    "imu_tk": by_imu_tk,
}


def export(form: str, *models: Model) -> ExportedFile:
    return export_model(models, form, "a test", Slot(), ExportSettings("/imu0", 200.0, {}))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("form", FORMATS)
def test_a_file_has_the_error_that_its_export_states(form: str, name: str) -> None:
    made = export(form, of(SENSORS[name]))
    a, t = forces(20_000)
    error = FORMATS[form](made.text, accelerometer(SENSORS[name], a, t), t) / G - a
    ((_, rms, most, unit),) = made.errors
    assert unit == "g"
    if name in (IN_DIAGONAL if form in ("px4", "ardupilot") else IN_FULL):
        assert made.losses == ()
        assert np.abs(error).max() < 1e-6
        return
    assert made.losses
    assert np.sqrt(np.mean(error**2, axis=0)).max() == pytest.approx(rms, rel=0.1)
    assert np.abs(error).max() == pytest.approx(most, rel=0.1)


@pytest.mark.parametrize("unit", ["g", "mg", "m/s^2"])
@pytest.mark.parametrize("form", FORMATS)
def test_a_file_corrects_readings_in_si_units_whatever_the_unit_of_the_model(form: str, unit: str) -> None:
    per = {"g": G, "mg": G / 1e3, "m/s^2": 1.0}[unit]
    values = {
        effect: {name: tuple(np.divide(numbers, per)) for name, numbers in given.items()}
        for effect, given in SENSORS["linear"].items()
    }
    a, t = forces(100)
    corrected = FORMATS[form](export(form, of(values, unit)).text, accelerometer(SENSORS["linear"], a, t), t)
    assert np.abs(corrected / G - a).max() < 1e-6


@pytest.mark.parametrize("form", ["px4", "ardupilot"])
def test_outside_the_calibrated_temperatures_the_correction_stays_constant(form: str) -> None:
    a, _ = forces(50)
    text = export(form, of(SENSORS["warm"])).text
    x = accelerometer(SENSORS["warm"], a, np.full(50, HOT))
    at_limit, beyond = (FORMATS[form](text, x, np.full(50, t)) for t in (HOT, HOT + 30))
    assert np.abs(at_limit - beyond).max() == 0
    assert np.abs(at_limit / G - a).max() < 1e-6


@pytest.mark.parametrize("unit", PER_DEG_S)
@pytest.mark.parametrize("form", ["px4", "ardupilot"])
def test_autopilots_correct_the_offset_of_rates(form: str, unit: str) -> None:
    per, rate = PER_DEG_S[unit], rates(100)
    values = {"gyro-bias": {"bias": tuple(per * RATE_BIAS)}, "gyro-scale-factor": {"scale": (per, per, per)}}
    made = export(form, of(values, unit))
    offset = xyz(parameters(made.text), "CAL_GYRO0_*OFF" if form == "px4" else "INS_GYROFFS_*")
    assert made.losses == ()
    assert np.abs(np.degrees(np.radians(rate + RATE_BIAS) - offset) - rate).max() < 1e-5


@pytest.mark.parametrize("unit", PER_DEG_S)
def test_imucal_corrects_rates_for_axes_that_lean_and_specific_force(unit: str) -> None:
    per, rate = PER_DEG_S[unit], rates(500)
    a, t = forces(500)
    lean = {"xy": 0.5, "xz": -0.4, "yx": 0.3, "yz": 0.2, "zx": -0.1, "zy": 0.6}
    xy, xz, yx, yz, zx, zy = np.sin(np.radians(list(lean.values())))
    sensing = np.array([[0, xy, xz], [yx, 0, yz], [zx, zy, 0]])
    sensing += np.diag(np.sqrt(1 - np.sum(sensing**2, axis=1)))
    scale = np.array([1.004, 0.997, 1.01])
    by_force = np.array([[0.05, 0.0, -0.1], [0.0, 0.15, 0.02], [0.1, 0.0, 0.0]])  # row: along, column: axis
    values = {
        "gyro-bias": {"bias": tuple(per * RATE_BIAS)},
        "gyro-scale-factor": {"scale": tuple(per * scale)},
        "gyro-misalignment": lean,
        "gyro-g-sensitivity": {along: tuple(per * by_force[k]) for k, along in enumerate("xyz")},
    }
    made = export("imucal", of(SENSORS["leaning"]), of(values, unit))
    c = {key: np.array(value) for key, value in json.loads(made.text).items() if isinstance(value, list)}
    readings = accelerometer(SENSORS["leaning"], a, t)
    force = (readings - c["b_a"]) @ (np.linalg.inv(c["R_a"]) @ np.linalg.inv(c["K_a"])).T
    turning = np.radians(RATE_BIAS + scale * (rate @ sensing.T) + a @ by_force)
    corrected = (turning - force @ c["K_ga"].T - c["b_g"]) @ (np.linalg.inv(c["R_g"]) @ np.linalg.inv(c["K_g"])).T
    assert made.losses == ()
    assert np.abs(force / G - a).max() < 1e-6
    assert np.abs(np.degrees(corrected) - rate).max() < 1e-5


@pytest.mark.parametrize("unit", ["gauss", "uT", "mgauss"])
@pytest.mark.parametrize("form", ["px4", "ardupilot"])
def test_an_exported_file_corrects_a_magnetometer_by_its_own_formula(form: str, unit: str) -> None:
    per = {"gauss": 1.0, "uT": 100.0, "mgauss": 1e3}[unit]
    m, _ = forces(300)
    bent = np.array([[1.05, 0.03, -0.01], [0.03, 0.98, 0.02], [-0.01, 0.02, 0.97]])
    offset = np.array([0.11, -0.07, 0.03])
    x = 0.48 * m @ bent.T + offset  # gauss
    values = {
        "field-strength": {"total": 0.48 * per},
        "hard-iron": {"offset": tuple(per * offset)},
        "soft-iron": {"xx": 0.05, "yy": -0.02, "xy": 0.03, "xz": -0.01, "yz": 0.02},
    }
    p = parameters(export(form, of(values, unit)).text)
    if form == "px4":
        moved, diagonal, odd = x - xyz(p, "CAL_MAG0_*OFF"), xyz(p, "CAL_MAG0_*SCALE"), xyz(p, "CAL_MAG0_*ODIAG")
    else:
        moved, diagonal, odd = x + xyz(p, "COMPASS_OFS_*") / 1e3, xyz(p, "COMPASS_DIA_*"), xyz(p, "COMPASS_ODI_*")
        assert p["COMPASS_SCALE"] == 0  # no other scale
    corrected = [
        diagonal[0] * moved[:, 0] + odd[0] * moved[:, 1] + odd[1] * moved[:, 2],
        odd[0] * moved[:, 0] + diagonal[1] * moved[:, 1] + odd[2] * moved[:, 2],
        odd[1] * moved[:, 0] + odd[2] * moved[:, 1] + diagonal[2] * moved[:, 2],
    ]
    assert np.abs(np.column_stack(corrected) - 0.48 * m).max() < 1e-6


def test_noise_made_from_a_file_of_kalibr_has_the_coefficients_of_the_model() -> None:
    """Kalibr: a sample has the standard deviation density sqrt(rate), a step of the bias walk / sqrt(rate)."""
    white, walk, rate = 2e-3, 4e-3, 50.0
    noises = {"white-noise": {"coefficient": white}, "rate-random-walk": {"coefficient": walk}}
    made = export_model(
        [of(noises), of(noises, "rad/s")], "kalibr", "a test", Slot(), ExportSettings("/imu0", rate, {})
    )
    read, rng = yaml.safe_load(made.text), np.random.default_rng(8)
    for sensor in ("accelerometer", "gyroscope"):
        samples = read[f"{sensor}_noise_density"] * np.sqrt(rate) * rng.normal(size=450_000)
        steps = read[f"{sensor}_random_walk"] / np.sqrt(rate) * rng.normal(size=450_000)
        for noise, tau_s, expected in ((samples, 1.0, white), (np.cumsum(steps), 3.0, walk)):
            means = noise.reshape(-1, int(tau_s * rate)).mean(axis=1)
            deviation = np.sqrt(0.5 * np.mean(np.diff(means) ** 2))
            assert deviation == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("precision", ["double", "float"])
@pytest.mark.parametrize("name", NAMES)
def test_c_gives_back_the_input_of_the_equations(compiler: str, precision: str, name: str, tmp_path: Path) -> None:
    fitted = of(SENSORS[name])
    within = Range.for_model(fitted, 1.5, temperature_c=(COLD, HOT))
    made = invert_model(fitted, within, precision=precision)
    a, t = forces(2000, 1.4)
    outputs = accelerometer(SENSORS[name], a, t)
    known = {**{f"v{axis}": outputs[:, k] for k, axis in enumerate("xyz")}, "temperature_c": t}
    files = written(made, tmp_path)
    (tmp_path / "driver.c").write_text(DRIVER)
    program = build(compiler, [*files, tmp_path / "driver.c"], tmp_path / "driver")
    rows = np.column_stack([known[column] for column in made.program.inputs])
    found = through(program, rows, 3, precision)
    assert np.abs(found - a).max() < {"double": 1e-11, "float": 2e-6}[precision]
