"""Tables of turned magnetometers and gyroscopes, made by formulas written out here, and the measured ones of others."""

from __future__ import annotations

import csv
import gzip
import json
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from calibrations.table import Array, Table

DATA = Path(__file__).parent.parent / "data"
DEVICES = ("BB", "CF", "FG", "HC", "HC_improved", "IB", "JG")


def sap6(device: str) -> Table:
    """The magnetometer of one SAP6."""
    mag = json.loads((DATA / "sap6_mag_acc" / f"{device}.json").read_text())["mag"]
    return magnetometer(np.array(mag), device)


def magnetometer(outputs: Array, source: str = "made", **more: Array) -> Table:
    """A table of positions of a magnetometer in uT, outputs of shape (n, 3)."""
    return Table.from_columns("positions", dict(zip(("mx", "my", "mz"), outputs.T, strict=True)) | more,
                              {"unit": "uT"}, source)  # fmt: skip


def in_iron(n: int, seed: int, noise: float = 0.05, directions: Array | None = None) -> Array:
    """Outputs (n, 3), uT, of a field of 48 uT from all sides, beside a magnet and iron, as a sensor in a frame of iron
    has it: three rods that strengthen the field along themselves."""
    rng = np.random.default_rng(seed)
    u = Rotation.random(n, rng=rng).as_matrix()[:, 2] if directions is None else directions
    rods = Rotation.from_euler("zyx", [25.0, -40.0, 10.0], degrees=True).as_matrix()
    field = 48.0 * u
    for rod, gain in zip(rods, (0.06, -0.03, 0.01), strict=True):
        field = field + gain * np.outer(48.0 * (u @ rod), rod)
    return field + np.array([12.0, -7.0, 21.0]) + noise * rng.standard_normal((n, 3))


def gyroscope(seed: int, *, lean_deg: float = 0.0, per_g: float = 0.0, noise: float = 0.02) -> Table:
    """Turns about six faces at four rates each way, in counts: 16 counts per deg/s, axes leaning, sensitive to g."""
    rng = np.random.default_rng(seed)
    up = np.repeat(np.vstack([np.eye(3), -np.eye(3)]), 9, axis=0)
    rate = np.tile([0.0, 20.0, -20.0, 50.0, -50.0, 90.0, -90.0, 140.0, -140.0], 6)
    lean = Rotation.from_rotvec([0.3 * lean_deg, -lean_deg, 0.6 * lean_deg], degrees=True)
    felt = lean.apply(rate[:, None] * up)
    outputs = felt * np.array([16.0, 15.5, 16.4]) + np.array([3.0, -8.0, 1.5])
    outputs[:, 0] += per_g * up[:, 2]
    outputs += noise * rng.standard_normal(outputs.shape)
    columns = dict(zip(("gx", "gy", "gz"), outputs.T, strict=True)) | dict(zip(("ax", "ay", "az"), up.T, strict=True))
    return Table.from_columns("rates", columns | {"rate_deg_s": rate, "t_s": 20.0 * np.arange(54)}, source="made")


def ferraris() -> Table:
    """Means of the six faces and the three turns of 360 deg, in counts."""
    parts: dict[str, list[list[float]]] = {}
    names = ("acc_x", "acc_y", "acc_z", "gyr_x", "gyr_y", "gyr_z")
    with gzip.open(DATA / "imucal_ferraris_gyro" / "annotated_session.csv.gz", "rt") as lines:
        for row in csv.DictReader(lines):
            parts.setdefault(row["part"], []).append([float(row[name]) for name in names])
    means = np.array([np.mean(rows, axis=0) for rows in parts.values()])
    rate = [360.0 * 204.8 / len(rows) if part.endswith("rot") else 0.0 for part, rows in parts.items()]
    columns = dict(zip(("ax", "ay", "az", "gx", "gy", "gz"), means.T, strict=True))
    return Table.from_columns("rates", columns | {"rate_deg_s": np.array(rate)}, source="ferraris")
