"""Files for other programs: the documented equation of each, applied to raw data, gives what the sensor felt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
import yaml
from imucal import FerrarisCalibrationInfo

from calibrations.errors import ModelError
from calibrations.exporting.autopilots import Slot
from calibrations.exporting.formats import export_model
from calibrations.exporting.noise_files import ExportSettings
from calibrations.exporting.simulated import ExportedFile
from calibrations.model import Model
from calibrations.table import Array
from tests.calibrations.fitted import Numbers, model

G = 9.80665
BIAS, SCALE = np.array([0.31, -0.22, 0.48]), np.array([9.9, 9.71, 9.84])  # m/s^2, m/s^2 in 1 g
SLOPE = np.array([4e-3, -2e-3, 7e-3])  # m/s^2/K
LINEAR: Mapping[str, Mapping[str, Numbers]] = {
    "bias": {"bias": tuple(BIAS.tolist())},
    "scale-factor": {"scale": tuple(SCALE.tolist())},
}
WARM = {**LINEAR, "temperature-bias": {"slope": tuple(SLOPE.tolist())}}
LEAN = {**LINEAR, "axis-nonorthogonality": {"xy": 0.4, "xz": -0.3, "yz": 0.2}}
SQUARE = {**LINEAR, "quadratic-nonlinearity": {"square": (0.05, 0.05, 0.05)}}
RATE_BIAS, RATE_SCALE = np.array([0.02, -0.03, 0.015]), np.array([1.004, 0.997, 1.01])
SETTINGS = ExportSettings("/imu0", 200.0, {})
COMPASS: Mapping[str, Mapping[str, Numbers]] = {
    "field-strength": {"total": 0.48},
    "hard-iron": {"offset": (0.11, -0.07, 0.03)},
    "soft-iron": {"xx": 0.05, "yy": -0.02, "xy": 0.03, "xz": -0.01, "yz": 0.02},
}


def of(values: Mapping[str, Mapping[str, Numbers]], unit: str = "m/s^2", **covered: tuple[float, float]) -> Model:
    return replace(model(values), unit=unit, covered=covered, name="mine")


def gyroscope() -> Model:
    values = {
        "gyro-bias": {"bias": tuple(RATE_BIAS)},
        "gyro-scale-factor": {"scale": tuple(RATE_SCALE * np.pi / 180)},
        "gyro-g-sensitivity": {"x": (0.001, 0.0, 0.002), "y": (0.0, 0.003, 0.0), "z": (0.001, 0.0, 0.0)},
    }
    return of(values, "rad/s")


def export(form: str, *models: Model, slot: Slot | None = None, settings: ExportSettings = SETTINGS) -> ExportedFile:
    return export_model(models, form, "a test", slot or Slot(), settings)


def felt(n: int = 50) -> Array:
    """Specific forces of 1 g, g, shape (n, 3)."""
    a = np.random.default_rng(5).normal(size=(n, 3))
    return np.asarray(a / np.linalg.norm(a, axis=1, keepdims=True))


def parameters(text: str) -> dict[str, float]:
    """Names and values of a file of PX4 or ArduPilot."""
    rows = [line.split("\t")[2:4] if "\t" in line else line.split(",") for line in text.splitlines()]
    return {row[0]: float(row[1]) for row in rows if len(row) == 2 and not row[0].startswith("#")}


def axes(found: Mapping[str, float], name: str) -> Array:
    return np.array([found[name.replace("*", axis)] for axis in "XYZ"])


def leaning(a: Array) -> Array:
    xy, xz, yz = np.sin(np.radians([0.4, -0.3, 0.2]))
    rows = [[1, 0, 0], [xy, np.sqrt(1 - xy**2), 0], [xz, yz, np.sqrt(1 - xz**2 - yz**2)]]
    return np.asarray(a @ np.array(rows).T)


def test_px4_corrects_offset_scale_and_temperature() -> None:
    a, t = felt(), np.linspace(10, 60, 50)
    x = BIAS + a * SCALE + (t - 25.0)[:, None] * SLOPE
    made = export("px4", of(WARM, temperature_c=(10.0, 60.0)), slot=Slot(0, 1310988))
    p = parameters(made.text)
    d = np.clip(t, p["TC_A0_TMIN"], p["TC_A0_TMAX"]) - p["TC_A0_TREF"]
    thermal = sum(np.outer(d**k, [p[f"TC_A0_X{k}_{i}"] for i in range(3)]) for k in range(4))
    corrected = (x - thermal - axes(p, "CAL_ACC0_*OFF")) * axes(p, "CAL_ACC0_*SCALE")
    assert np.abs(corrected / G - a).max() < 1e-6
    assert (p["CAL_ACC0_ID"], p["TC_A0_ID"], p["TC_A_ENABLE"]) == (1310988, 1310988, 1)
    assert made.losses == ()


def test_ardupilot_corrects_offset_scale_and_temperature() -> None:
    a, t = felt(), np.linspace(10, 60, 50)
    x = BIAS + a * SCALE + (t - 25.0)[:, None] * SLOPE
    p = parameters(export("ardupilot", of(WARM, temperature_c=(10.0, 60.0)), slot=Slot(1)).text)

    def polynomial(at: Array) -> Array:
        d = np.clip(at, p["INS_TCAL2_TMIN"], p["INS_TCAL2_TMAX"]) - 35
        return np.asarray(sum(np.outer(d**k, 1e-6 * axes(p, f"INS_TCAL2_ACC{k}_*")) for k in (1, 2, 3)))

    warm = x - polynomial(t) + polynomial(np.array([p["INS_ACC2_CALTEMP"]]))
    corrected = (warm - axes(p, "INS_ACC2OFFS_*")) * axes(p, "INS_ACC2SCAL_*")
    assert np.abs(corrected / G - a).max() < 1e-6


def test_autopilots_correct_the_compass() -> None:
    m = felt()
    bent = np.array([[1.05, 0.03, -0.01], [0.03, 0.98, 0.02], [-0.01, 0.02, 0.97]])
    x = 0.48 * m @ bent + [0.11, -0.07, 0.03]
    for form in ("px4", "ardupilot"):
        made = export(form, of(COMPASS, "gauss"))
        p = parameters(made.text)
        if form == "px4":
            diagonal, odd = axes(p, "CAL_MAG0_*SCALE"), axes(p, "CAL_MAG0_*ODIAG")
            moved = x - axes(p, "CAL_MAG0_*OFF")
        else:
            diagonal, odd = axes(p, "COMPASS_DIA_*"), axes(p, "COMPASS_ODI_*")
            moved = (1e3 * x + axes(p, "COMPASS_OFS_*")) / 1e3
        xy, xz, yz = odd
        matrix = np.diag(diagonal) + np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])
        assert np.abs(moved @ matrix.T - 0.48 * m).max() < 1e-6
        assert made.losses == ()


def test_matrices_of_ros_and_imu_tk_correct_axes_that_lean() -> None:
    a = felt()
    x = BIAS + leaning(a) * SCALE
    ros = yaml.safe_load(export("imu_calib", of(LEAN)).text)
    corrected = x @ np.reshape(ros["SM"], (3, 3)).T - ros["bias"]
    assert np.abs(corrected / G - a).max() < 1e-6
    numbers = np.array(export("imu_tk", of(LEAN)).text.split(), dtype=float)
    t, k, b = numbers[:9].reshape(3, 3), numbers[9:18].reshape(3, 3), numbers[18:]
    assert np.allclose(np.diag(t), 1)
    assert np.abs((x - b) @ (t @ k).T / G - a).max() < 1e-6


def test_imucal_corrects_both_sensors() -> None:
    a, w = felt(), np.random.default_rng(2).uniform(-3, 3, (50, 3))
    x = BIAS + leaning(a) * SCALE
    sensitivity = np.array([[0.001, 0.0, 0.001], [0.0, 0.003, 0.0], [0.002, 0.0, 0.0]])
    y = RATE_BIAS + w * RATE_SCALE + a @ sensitivity.T
    made = export("imucal", of(LEAN), gyroscope())
    force, rate = FerrarisCalibrationInfo.from_json(made.text).calibrate(x, y, "m/s^2", "rad/s")
    assert np.abs(force / G - a).max() < 1e-6
    assert np.abs(rate - w).max() < 1e-8
    assert made.losses == ()


def test_what_a_format_cannot_hold_is_named_with_its_error() -> None:
    (loss,) = export("imu_calib", of(SQUARE)).losses
    assert loss.effect == "quadratic-nonlinearity"
    assert loss.most == pytest.approx(2 / 3 * 0.05 / 9.8, rel=0.03)  # a^2 over the sphere has the mean 1/3
    lean = {found.effect: found for found in export("px4", of(LEAN)).losses}
    assert lean["axis-nonorthogonality"].most == pytest.approx(np.radians(0.4), rel=0.2)
    gains = {found.effect: found for found in export("px4", gyroscope()).losses}
    assert gains["gyro-scale-factor"].most == pytest.approx(300 * 0.01, rel=0.01)  # deg/s, of the z axis
    assert "gyro-g-sensitivity" in gains


def test_px4_names_small_corrections_that_it_does_not_apply() -> None:
    small = {"bias": {"bias": (0.005, 0.0, 0.0)}, "scale-factor": {"scale": (1.004 * G, G, G)}}
    losses = {loss.effect: loss for loss in export("px4", of(small)).losses}
    assert losses["offset"].most == pytest.approx(0.005 / G, rel=0.01)
    assert losses["scale"].most == pytest.approx(0.004, rel=0.01)


def test_kalibr_and_openvins_read_densities_in_si_units() -> None:
    accelerometer = of({"white-noise": {"coefficient": 1e-4}, "flicker-noise": {"coefficient": 1e-5}}, "g")
    turning = of({"white-noise": {"coefficient": 2e-3}, "rate-random-walk": {"coefficient": 1e-5}}, "deg/s")
    settings = ExportSettings("/imu0", 200.0, {"accelerometer": 4e-6})
    made = export("kalibr", accelerometer, turning, settings=settings)
    read = yaml.safe_load(made.text)
    assert read.pop("rostopic") == "/imu0"
    assert read == pytest.approx(
        {
            "accelerometer_noise_density": 1e-4 * G,
            "accelerometer_random_walk": 4e-6,
            "gyroscope_noise_density": np.radians(2e-3),
            "gyroscope_random_walk": np.radians(1e-5),
            "update_rate": 200,
        },
        rel=1e-5,
    )
    (lost,) = made.losses
    assert (lost.effect, lost.most) == ("flicker-noise of the accelerometer", pytest.approx(0.664e-5))
    made = export("openvins", accelerometer, turning, settings=settings)
    chain = yaml.safe_load(made.text.removeprefix("%YAML:1.0\n"))["imu0"]
    assert {key: chain[key] for key in read} == read
    assert all(np.allclose(chain[name], np.eye(3)) for name in ("Tw", "Ta", "R_IMUtoGYRO", "R_IMUtoACC"))


@pytest.mark.parametrize(
    ("form", "models", "message"),
    [
        ("px4", [of(LINEAR, "V")], "Calibrate from a log of PX4"),
        ("px4", [of({"bias": {"bias": (0.1, 0.1)}, "scale-factor": {"scale": (9.8, 9.8)}})], "hold three axes"),
        ("px4", [of(WARM)], "give --input temperature_c=LOW:HIGH"),
        (
            "ardupilot",
            [of({**LINEAR, "bias": {"bias": (4.0, 0.0, 0.0)}})],
            "ArduPilot accepts offset from -3.5 to 3.5",
        ),
        ("imucal", [of(LINEAR)], "one of each"),
        ("imu_tk", [gyroscope()], "one accelerometer"),
        ("kalibr", [of(LINEAR)], "has no noise"),
        ("kalibr", [of({"white-noise": {"coefficient": 1e-4}}, "g")], "noise of the gyroscope as well"),
    ],
)
def test_a_sensor_that_a_format_cannot_hold_is_refused(form: str, models: list[Model], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        export(form, *models)
