"""Plausible but physically wrong inputs: what a person, a cable or a program does to a good file of measurements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from calibrations.table import Array
from tests.rig.measurement_files import (
    CORNER_HZ,
    GRAVITY,
    INFLATION,
    NOISE_V,
    SAMPLES,
    File,
    poses,
    positions,
    rates,
)

Spoil = Callable[[File], File]


def _pick(file: File, rows: Array, name: str, value: float) -> File:
    return file.changed(**{name: np.where(rows, value, file.columns[name])})


def _in(file: File, cells: Callable[[float], str], name: str, rows: slice = slice(0, 3)) -> File:
    values = file.columns[name]
    return replace(file, texts={(i, name): cells(float(values[i])) for i in range(file.n)[rows]})


def _back(file: File, seconds: float) -> File:
    """A clock that is set back in the middle of the file."""
    half = np.arange(file.n) >= file.n // 2
    return file.changed(t_s=file.columns["t_s"] - np.where(half, seconds, 0.0))


def _roll(name: str) -> Spoil:
    return lambda f: f.changed(**{name: np.roll(f.columns[name], 1)})


def _turned(f: File) -> File:
    return f.changed(vx_v=2.5 + (f.columns["vy_v"] - 2.5), vy_v=5.0 - f.columns["vx_v"])


def _clip(name: str, most: float) -> Spoil:
    return lambda f: f.changed(**{name: np.minimum(f.columns[name], most)})


def _all(names: str, of: Callable[[Array], Array]) -> Spoil:
    return lambda f: f.changed(**{name: of(f.columns[name]) for name in names.split()})


ANGLES, VOLTS, STDS = "alpha_deg beta_deg", "vx_v vy_v", "vx_std_v vy_std_v"
A, M, G = "ax ay az", "mx my mz", "gx gy gz"

WRONG: Mapping[str, Mapping[str, Spoil]] = {
    "poses": {
        "alpha and beta are exchanged": lambda f: f.swapped("alpha_deg", "beta_deg"),
        "angles in radians": _all(ANGLES, np.radians),
        "beta alone in radians": lambda f: f.changed(beta_deg=np.radians(f.columns["beta_deg"])),
        "angles converted to degrees twice": _all(ANGLES, np.degrees),
        "angles in gradians": _all(ANGLES, lambda v: v / 0.9),
        "angles rounded to 10 deg": _all(ANGLES, lambda v: 10 * np.round(v / 10)),
        "alpha counted from the horizontal": lambda f: f.changed(alpha_deg=90 - f.columns["alpha_deg"]),
        "beta counts backwards": lambda f: f.scaled("beta_deg", -1.0),
        "alpha counts backwards": lambda f: f.scaled("alpha_deg", -1.0),
        "beta with wrong steps a turn": lambda f: f.scaled("beta_deg", 1.25),
        "alpha with wrong steps a turn": lambda f: f.scaled("alpha_deg", 0.8),
        "beta with half the gear ratio": lambda f: f.scaled("beta_deg", 0.5),
        "steps a turn off by 1 %": lambda f: f.scaled("beta_deg", 1.01),
        "the zero of beta is off by 90 deg": lambda f: f.scaled("beta_deg", 1.0, 90.0),
        "the zero of alpha is off by 30 deg": lambda f: f.scaled("alpha_deg", 1.0, 30.0),
        "the zero of alpha is off by 3 deg": lambda f: f.scaled("alpha_deg", 1.0, 3.0),
        "the zero of beta is off by 3 deg": lambda f: f.scaled("beta_deg", 1.0, 3.0),
        "beta lost a turn's tenth in mid-run": lambda f: f.changed(
            beta_deg=f.columns["beta_deg"] + np.where(np.arange(f.n) > f.n // 2, 36.0, 0.0)
        ),
        "channels are exchanged": lambda f: f.swapped("vx_v", "vy_v"),
        "one channel read twice": lambda f: f.changed(vy_v=f.columns["vx_v"]),
        "the sensor is turned by 90 deg": _turned,
        "the sensor is turned by 180 deg": _all(VOLTS, lambda v: 5.0 - v),
        "the sensor is mounted face down": lambda f: f.changed(vy_v=5.0 - f.columns["vy_v"]),
        "the sign of one output": lambda f: f.scaled("vx_v", -1.0),
        "an output is stuck in most rows": lambda f: _pick(f, f.some(0.8), "vx_v", 2.5),
        "an output is constant": lambda f: f.changed(vx_v=np.full(f.n, 2.5)),
        "an output holds noise only": lambda f: f.changed(
            vy_v=2.5 + NOISE_V * np.random.default_rng(7).standard_normal(f.n)
        ),
        "an output is saturated": _clip("vx_v", 3.0),
        "both outputs are saturated at the supply": _all(VOLTS, lambda v: np.clip(v, 1.7, 3.3)),
        "outputs are rounded to 0.1 V": _all(VOLTS, lambda v: np.round(v, 1)),
        "outputs in mV": _all(VOLTS, lambda v: 1e3 * v),
        "one output in mV": lambda f: f.scaled("vy_v", 1e3),
        "outputs and their noise in mV": _all(f"{VOLTS} {STDS}", lambda v: 1e3 * v),
        "outputs in ADC counts": _all(VOLTS, lambda v: np.round(v / 5 * 4096)),
        "outputs before a divider of 10": _all(VOLTS, lambda v: v / 10),
        "the rows of vx are shifted by one": _roll("vx_v"),
        "the rows of the angles are shifted by one": lambda f: _roll("alpha_deg")(_roll("beta_deg")(f)),
        "two sensors in one file": lambda f: f.beside(poses(8, 2.52)),
        "two sensors in one file, of other scale": lambda f: f.beside(poses(8, 2.5, 1.05)),
        "every row twice": lambda f: f.taken(np.repeat(np.arange(f.n), 2)),
        "every row twice, without times": lambda f: replace(
            f, columns={k: np.repeat(v, 2) for k, v in f.columns.items() if k != "t_s"}
        ),
        "two rows have a swapped sign": lambda f: _pick(f, np.isin(np.arange(f.n), (40, 90)), "vx_v", 0.1),
        "rows are shuffled": lambda f: f.taken(np.random.default_rng(3).permutation(f.n)),
        "outputs are shuffled": lambda f: f.changed(
            **{k: np.random.default_rng(8).permutation(f.columns[k]) for k in VOLTS.split()}
        ),
        "time in milliseconds": lambda f: f.scaled("t_s", 1e3),
        "time in minutes": lambda f: f.scaled("t_s", 1 / 60),
        "time is constant": lambda f: f.scaled("t_s", 0.0),
        "time starts again in mid-run": lambda f: f.changed(t_s=7.0 * (np.arange(f.n) % (f.n // 2))),
        "variance in place of the standard deviation": _all(STDS, np.square),
        "standard error in place of the standard deviation": _all(STDS, lambda v: v * np.sqrt(INFLATION / SAMPLES)),
        "standard deviation in mV": _all(STDS, lambda v: 1e3 * v),
        "standard deviation of one output in mV": lambda f: f.scaled("vy_std_v", 1e3),
        "n is 1": lambda f: f.changed(n=np.ones(f.n)),
        "n counts the rows": lambda f: f.changed(n=np.arange(1.0, f.n + 1)),
        "n is 100 times too great": lambda f: f.scaled("n", 100.0),
        "the filter's corner in rad/s": lambda f: f.stated(filter_corner_hz=2 * np.pi * CORNER_HZ),
        "the filter's corner in kHz": lambda f: f.stated(filter_corner_hz=CORNER_HZ / 1e3),
        "the filter's corner of another capacitor": lambda f: f.stated(filter_corner_hz=150.7),
        "the sample rate in kHz": lambda f: f.stated(sample_rate_hz=1.0),
        "the sample interval as the rate": lambda f: f.stated(sample_rate_hz=1e-3),
        "gravity of 1": lambda f: f.stated(gravity_m_s2=1),
        "gravity in cm/s^2": lambda f: f.stated(gravity_m_s2=980.131),
        "gravity with a decimal comma": lambda f: f.stated(gravity_m_s2="9,80131"),
        "local gravity is off by 0.3 %": lambda f: f.stated(gravity_m_s2=round(GRAVITY * 1.003, 5)),
        "local gravity is off by 2 %": lambda f: f.stated(gravity_m_s2=round(GRAVITY * 1.02, 5)),
        "temperature in kelvin": lambda f: f.scaled("temperature_c", 1.0, 273.15),
        "temperature in Fahrenheit": lambda f: f.scaled("temperature_c", 1.8, 32.0),
        "temperature in tenths of a degree": lambda f: f.scaled("temperature_c", 10.0),
        "temperature in mV of the sensor": lambda f: f.scaled("temperature_c", 10.0, 500.0),
        "a dropped decimal point": lambda f: _in(f, lambda v: f"{v:.5f}".replace(".", ""), "vx_v"),
        "decimal commas in some rows": lambda f: _in(f, lambda v: f'"{v:.5f}"'.replace(".", ","), "vx_v"),
        "NaN for missing readings": lambda f: _in(f, lambda _: "nan", "vx_v"),
        "-999 for missing readings": lambda f: _pick(f, f.some(0.02), "vx_v", -999.0),
        "-9.99 for missing readings": lambda f: _pick(f, f.some(0.02), "vx_v", -9.99),
        "0 for missing readings": lambda f: _pick(f, f.some(0.02), "vx_v", 0.0),
        "0 V from one row on": lambda f: _pick(f, np.arange(f.n) > 150, "vx_v", 0.0),
        "-999 for missing temperatures": lambda f: _pick(f, f.some(0.02), "temperature_c", -999.0),
        "0 for missing temperatures": lambda f: _pick(f, f.some(0.02), "temperature_c", 0.0),
        "the header names vx for the temperature": lambda f: f.swapped("vx_v", "temperature_c"),
        "the header names std for the output": lambda f: f.swapped("vx_v", "vx_std_v"),
        "directions of the approach are reversed": lambda f: f.scaled("direction", -1.0),
        "directions of the approach as -10 and 10": lambda f: f.scaled("direction", 10.0),
        "face down is stated as -1": lambda f: f.changed(flip=np.full(f.n, -1.0), vy_v=5.0 - f.columns["vy_v"]),
        "face down is stated as 180": lambda f: f.changed(flip=np.full(f.n, 180.0), vy_v=5.0 - f.columns["vy_v"]),
        "the mount in radians": lambda f: f.changed(mount_deg=np.full(f.n, np.pi)),
        "some rows of another sensor": lambda f: f.mixed(poses(8, 2.52), 0.15),
        "two sensors mixed at random": lambda f: f.mixed(poses(8, 2.52), 0.5),
        "time in hours": lambda f: f.scaled("t_s", 1 / 3600),
        "n is negative": lambda f: f.scaled("n", -1.0),
    },
    "positions": {
        "outputs in m/s^2 stated as g": _all(A, lambda v: 9.80665 * v),
        "outputs in mg stated as g": _all(A, lambda v: 1e3 * v),
        "one axis in m/s^2": lambda f: f.scaled("ax", 9.80665),
        "one axis read twice": lambda f: f.changed(ay=f.columns["ax"]),
        "an axis is constant": lambda f: f.changed(az=np.full(f.n, 0.02)),
        "an axis holds noise only": lambda f: f.changed(
            az=0.02 + 1e-4 * np.random.default_rng(7).standard_normal(f.n)
        ),
        "an axis is stuck in half of the rows": lambda f: _pick(f, f.some(0.5), "az", 0.4),
        "an axis without its sign": lambda f: f.changed(az=np.abs(f.columns["az"])),
        "an axis is saturated": _clip("ax", 0.6),
        "rows of one axis are shifted by one": _roll("ay"),
        "two sensors in one file": lambda f: f.beside(positions(1, 1.0, 0.13)),
        "every row twice, without times": lambda f: replace(
            f, columns={k: np.repeat(v, 2) for k, v in f.columns.items() if k != "t_s"}
        ),
        "variance in place of the standard deviation": _all("ax_std ay_std az_std", np.square),
        "standard error in place of the standard deviation": _all("ax_std ay_std az_std", lambda v: v / 10),
        "standard deviation in mg": _all("ax_std ay_std az_std", lambda v: 1e3 * v),
        "-999 for missing readings": lambda f: _pick(f, np.arange(f.n) == 7, "ax", -999.0),
        "0 for missing readings": lambda f: _pick(f, f.some(0.1), "ax", 0.0),
        "the sensor moved in some positions": lambda f: f.changed(
            **{k: f.columns[k] + np.where(np.arange(f.n) % 9 == 4, 0.2, 0.0) for k in A.split()}
        ),
    },
    "rates": {
        "the rate in rad/s": lambda f: f.changed(rate_deg_s=np.radians(f.columns["rate_deg_s"])),
        "the rate in revolutions a minute": lambda f: f.scaled("rate_deg_s", 1 / 6),
        "the rate without its sign": lambda f: f.changed(rate_deg_s=np.abs(f.columns["rate_deg_s"])),
        "the table turns backwards": lambda f: f.scaled("rate_deg_s", -1.0),
        "x and y are exchanged": lambda f: f.swapped("gx", "gy"),
        "an axis has the wrong sign": lambda f: f.scaled("gz", -1.0),
        "an axis is constant": lambda f: f.changed(gy=np.full(f.n, 0.3)),
        "an axis is stuck in half of the rows": lambda f: _pick(f, f.some(0.5), "gx", 0.3),
        "an axis is saturated": _clip("gx", 60.0),
        "an axis in other units": lambda f: f.scaled("gx", 1e3),
        "rows of the rate are shifted by one": _roll("rate_deg_s"),
        "two sensors in one file": lambda f: f.beside(rates(2, 1.05)),
        "variance in place of the standard deviation": _all("gx_std gy_std gz_std", np.square),
        "standard error in place of the standard deviation": _all("gx_std gy_std gz_std", lambda v: v / 500**0.5),
        "0 for missing readings": lambda f: _pick(f, f.some(0.1), "gx", 0.0),
        "latitude in radians": lambda f: f.stated(latitude_deg=0.02356),
        "latitude of 135": lambda f: f.stated(latitude_deg=135),
        "gyroscope and accelerometer are exchanged": lambda f: (
            f.swapped("gx", "ax").swapped("gy", "ay").swapped("gz", "az")
        ),
    },
    "fields": {
        "outputs in nT stated as uT": _all(M, lambda v: 1e3 * v),
        "outputs in mG stated as uT": _all(M, lambda v: 10 * v),
        "one axis in other units": lambda f: f.scaled("mx", 1e3),
        "one axis read twice": lambda f: f.changed(my=f.columns["mx"]),
        "an axis is constant": lambda f: f.changed(mz=np.full(f.n, 21.0)),
        "an axis holds noise only": lambda f: f.changed(
            mz=21 + 0.02 * np.random.default_rng(7).standard_normal(f.n)
        ),
        "an axis without its sign": lambda f: f.changed(mz=np.abs(f.columns["mz"] - 21)),
        "an axis is saturated": _clip("mx", 40.0),
        "rows of one axis are shifted by one": _roll("my"),
        "two sensors in one file": lambda f: f.changed(mx=f.columns["mx"] + 5.0 * (np.arange(f.n) % 2)),
        "variance in place of the standard deviation": _all("mx_std my_std mz_std", np.square),
        "0 for missing readings": lambda f: _pick(f, f.some(0.1), "mx", 0.0),
        "outputs in gauss stated as uT": _all(M, lambda v: v / 100),
        "iron came near in mid-run": lambda f: f.changed(
            mx=f.columns["mx"] + np.where(np.arange(f.n) > f.n // 2, 10.0, 0.0)
        ),
        "the accelerometer in the columns of the field": lambda f: f.changed(
            **dict(zip(M.split(), Rotation.random(f.n, rng=np.random.default_rng(1)).as_matrix()[:, 2].T, strict=True))
        ),
    },
    "motion": {
        "time in milliseconds": lambda f: f.scaled("t_s", 1e3),
        "displacement in mm": lambda f: f.scaled("displacement_m", 1e3),
        "displacement in um": lambda f: f.scaled("displacement_m", 1e6),
        "displacement with the wrong sign": lambda f: f.scaled("displacement_m", -1.0),
        "the displacement sensor is stuck": lambda f: f.scaled("displacement_m", 0.0),
        "displacement shifted by 10 rows": lambda f: f.changed(displacement_m=np.roll(f.columns["displacement_m"], 10)),
        "velocity in place of displacement": lambda f: f.changed(
            displacement_m=np.gradient(f.columns["displacement_m"], 1e-3)
        ),
        "outputs in mV": _all(VOLTS, lambda v: 1e3 * v),
        "channels are exchanged": lambda f: f.swapped("vx_v", "vy_v"),
        "alpha and beta are exchanged": lambda f: f.swapped("alpha_deg", "beta_deg"),
        "an output is constant": lambda f: f.changed(vx_v=np.full(f.n, 2.5)),
        "the filter's corner in rad/s": lambda f: f.stated(filter_corner_hz=2 * np.pi * CORNER_HZ),
        "the filter's corner in kHz": lambda f: f.stated(filter_corner_hz=CORNER_HZ / 1e3),
        "gravity of 1": lambda f: f.stated(gravity_m_s2=1),
    },
    "still": {
        "time in milliseconds": lambda f: f.scaled("t_s", 1e3),
        "time is constant": lambda f: f.scaled("t_s", 0.0),
        "rows are shuffled": lambda f: f.taken(np.random.default_rng(3).permutation(f.n)),
        "every row twice": lambda f: f.taken(np.repeat(np.arange(f.n), 2)),
        "the clock is set back": lambda f: _back(f, 60.0),
        "an output is constant": lambda f: f.changed(vx_v=np.full(f.n, 2.5)),
        "an output is stuck for a minute": lambda f: _pick(f, abs(np.arange(f.n) - 20000) < 3000, "vx_v", 2.5),
        "outputs in mV": lambda f: f.scaled("vx_v", 1e3),
        "-999 for missing readings": lambda f: _pick(f, f.some(0.001), "vx_v", -999.0),
        "0 for missing readings": lambda f: _pick(f, f.some(0.001), "vx_v", 0.0),
        "the sensor was moved in mid-record": lambda f: f.changed(
            vx_v=f.columns["vx_v"] + np.where(np.arange(f.n) > f.n // 2, 0.3, 0.0)
        ),
        "an output is saturated": _clip("vx_v", 2.501),
    },
}  # fmt: skip

UNSEEN: Mapping[str, Mapping[str, tuple[Spoil, str]]] = {  # what no data of this kind can show, and what shows it
    "rates": {
        "the rate is off by 1 %": (
            lambda f: f.scaled("rate_deg_s", 1.01),
            "a gyroscope with another scale factor gives the same file; compare with a second rate table",
        ),
    },
    "fields": {
        "one axis has the wrong sign": (
            lambda f: f.scaled("my", -1.0),
            "only the magnitude of the field is known; a turn to a known azimuth shows it",
        ),
    },
    "positions": {
        "x and y are exchanged": (
            lambda f: f.swapped("ax", "ay"),
            "only the magnitude of gravity is known; a run of poses at known angles shows it",
        ),
        "one axis has the wrong sign": (
            lambda f: f.scaled("ax", -1.0),
            "only the magnitude of gravity is known; a run of poses at known angles shows it",
        ),
    },
    "poses": {
        "outputs and their noise before a divider of 10": (
            lambda f: f.scaled_all(f"{VOLTS} {STDS}", 0.1),
            "a sensor of a tenth of the sensitivity gives the same file; compare with the data sheet",
        ),
    },
}
