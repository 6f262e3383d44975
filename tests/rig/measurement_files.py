"""Good files of measurements of each kind, fitted without a remark, by formulas of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from calibrations.table import Array
from tests.calibrations.shaken import TWO, record
from tests.calibrations.synthetic import components, turns
from tests.calibrations.turned import in_iron

NOISE_V = 50e-6  # of a mean
SAMPLES = 5000.0
CORNER_HZ, RATE_HZ = 15.07, 1000.0
RHO = np.exp(-2 * np.pi * CORNER_HZ / RATE_HZ)  # from one sample to the next, behind a first-order low-pass
INFLATION = (1 + RHO) / (1 - RHO)
GRAVITY = 9.80131


@dataclass(frozen=True)
class File:
    """Columns and constants of a file, and the model that is fitted to it; `gaps` of cells that are written as text."""

    columns: Mapping[str, Array]
    constants: Mapping[str, object] = field(default_factory=dict)
    model: str = "linear"
    texts: Mapping[tuple[int, str], str] = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Rows."""
        return len(next(iter(self.columns.values())))

    def text(self) -> str:
        """The file as comma-separated values."""
        rows = [
            ",".join(self.texts.get((i, name), repr(float(values[i]))) for name, values in self.columns.items())
            for i in range(self.n)
        ]
        return "\n".join([*(f"# {k}: {v}" for k, v in self.constants.items()), ",".join(self.columns), *rows, ""])

    def changed(self, **columns: Array) -> File:
        """The same with these columns."""
        return replace(self, columns={**self.columns, **columns})

    def stated(self, **constants: object) -> File:
        """The same with these constants."""
        return replace(self, constants={**self.constants, **constants})

    def scaled(self, name: str, factor: float, offset: float = 0.0) -> File:
        """The same with one column in another unit."""
        return self.changed(**{name: self.columns[name] * factor + offset})

    def scaled_all(self, names: str, factor: float) -> File:
        """The same with several columns in another unit."""
        return self.changed(**{name: self.columns[name] * factor for name in names.split()})

    def swapped(self, one: str, other: str) -> File:
        """The same with the values of two columns exchanged."""
        return self.changed(**{one: self.columns[other], other: self.columns[one]})

    def taken(self, rows: Array) -> File:
        """Some rows, in this order."""
        return replace(self, columns={name: values[rows] for name, values in self.columns.items()})

    def some(self, share: float, seed: int = 6) -> Array:
        """A random choice of rows, as a mask."""
        return np.random.default_rng(seed).random(self.n) < share

    def beside(self, other: File, every: int = 2) -> File:
        """Rows of another sensor in place of one in `every`."""
        rows = np.arange(self.n) % every == 1
        return self.changed(**{k: np.where(rows, other.columns[k], v) for k, v in self.columns.items()})

    def mixed(self, other: File, share: float) -> File:
        """Rows of another sensor in place of a random share."""
        return self.changed(**{k: np.where(self.some(share), other.columns[k], v) for k, v in self.columns.items()})


def poses(seed: int = 5, bias: float = 2.5, scale: float = 1.0) -> File:
    """A dual-axis accelerometer on two stages."""
    base, rng = turns(), np.random.default_rng(seed)
    ax, ay, _ = components(base)
    n = len(ax)
    noise = NOISE_V * rng.standard_normal((2, n))
    std = NOISE_V * np.sqrt(SAMPLES / INFLATION) * (1 + 0.02 * rng.standard_normal((2, n)))
    return File(
        {
            **base,
            "vx_v": bias + scale * ax + noise[0],
            "vy_v": bias + 0.01 + 1.02 * scale * ay + noise[1],
            "vx_std_v": std[0],
            "vy_std_v": std[1],
            "n": np.full(n, SAMPLES),
            "temperature_c": 24.0 + 0.5 * np.sin(np.arange(n) / 60) + 0.002 * rng.standard_normal(n),
        },
        {"gravity_m_s2": GRAVITY, "filter_corner_hz": CORNER_HZ, "sample_rate_hz": RATE_HZ},
    )


def positions(seed: int = 1, factor: float = 1.0, bias: float = 0.03) -> File:
    """A triaxial accelerometer held by hand, in g."""
    rng = np.random.default_rng(seed)
    u = Rotation.random(40, rng=rng).as_matrix()[:, 2]
    a = 1.01 * factor * u + np.array([bias, -0.02, 0.05]) + 2e-4 * rng.standard_normal((40, 3))
    std = 2e-3 * (1 + 0.05 * rng.standard_normal((3, 40)))
    columns = {f"a{axis}": a[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"a{axis}_std": std[k] for k, axis in enumerate("xyz")}
    return File(columns | {"n": np.full(40, 100.0), "t_s": 10.0 * np.arange(40)}, {"unit": "g"}, "common-scale")


def rates(seed: int = 2, factor: float = 1.0) -> File:
    """A gyroscope on a rate table, turned about six faces, with the accelerometer beside it."""
    rng = np.random.default_rng(seed)
    up = np.repeat(np.vstack([np.eye(3), -np.eye(3)]), 9, axis=0)
    rate = np.tile([0.0, 20.0, -20.0, 50.0, -50.0, 90.0, -90.0, 140.0, -140.0], 6)
    g = factor * rate[:, None] * up * np.array([1.0, 0.97, 1.02]) + np.array([0.3, -0.8, 0.15])
    g += 0.0041781 * np.sin(np.radians(1.35)) * up + 0.002 * rng.standard_normal((54, 3))
    columns = {f"g{axis}": g[:, k] for k, axis in enumerate("xyz")} | {
        f"a{axis}": up[:, k] for k, axis in enumerate("xyz")
    }
    std = {f"g{axis}_std": np.full(54, 0.002 * np.sqrt(500)) for axis in "xyz"}
    more = {"n": np.full(54, 500.0), "rate_deg_s": rate, "t_s": 20.0 * np.arange(54)}
    return File(columns | std | more, {"latitude_deg": 1.35, "unit": "deg/s"}, "gyroscope")


def fields(seed: int = 3) -> File:
    """A magnetometer turned to all sides, in uT."""
    m = in_iron(200, seed)
    columns = {f"m{axis}": m[:, k] for k, axis in enumerate("xyz")}
    std = {f"m{axis}_std": np.full(200, 0.05 * np.sqrt(100)) for axis in "xyz"}
    return File(columns | std | {"n": np.full(200, 100.0)}, {"unit": "uT"}, "magnetometer")


def motion() -> File:
    """A shaken dual-axis accelerometer with a displacement sensor."""
    table = record(TWO, attitudes=((45.0, 90.0), (90.0, 0.0), (30.0, 200.0)), constants={})
    return File(dict(table.columns), table.constants)


def still(seed: int = 4, minutes: float = 10.0) -> File:
    """A sensor at rest: white noise behind its output filter, 100 samples a second."""
    rng = np.random.default_rng(seed)
    n = int(minutes * 6000)
    return File(
        {"t_s": np.arange(n) / 100, "vx_v": 2.5 + 1e-3 * rng.standard_normal(n)}, {"sample_rate_hz": 100}, "still"
    )


GOOD: Mapping[str, Callable[[], File]] = {
    "poses": poses,
    "positions": positions,
    "rates": rates,
    "fields": fields,
    "motion": motion,
    "still": still,
}
