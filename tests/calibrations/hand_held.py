"""Tables of hand-held positions with a known curve at one place of the signal chain, in g."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.table import Array, Table

NOISE_G = 1e-4
N = 120
SHARES = np.array([1.0, -0.6, 0.4])  # of a curve, by axis


@dataclass(frozen=True)
class Held:
    """A sensor in the hand, held still at `N` random directions; `seed` gives directions, times and noise."""

    seed: int = 0

    @property
    def up(self) -> Array:
        """Directions of gravity, (N, 3)."""
        random = np.random.default_rng([self.seed, 3]).standard_normal((N, 3))
        return np.asarray(random / np.linalg.norm(random, axis=1, keepdims=True))

    @property
    def t_s(self) -> Array:
        """Times, s: about ten seconds for each position."""
        return np.cumsum(np.random.default_rng([self.seed, 5]).uniform(6, 14, N))

    @property
    def temperature_c(self) -> Array:
        """A temperature that rises and falls."""
        return 25 + 5 * np.sin(self.t_s / 300 + self.seed) + 0.3 * np.sin(self.t_s / 40)

    def table(self, added: Array | float = 0.0, scatter: float = 0.0) -> Table:
        """The table of the sensor whose outputs have the part `added`, (N, 3) and the hand's `scatter`, floors."""
        noise = NOISE_G * np.hypot(1, scatter) * np.random.default_rng([self.seed, 7]).standard_normal((N, 3))
        outputs = self.up * [1.02, 0.98, 1.01] + [0.01, -0.02, 0.03] + added + noise
        columns = {f"a{axis}": outputs[:, k] for k, axis in enumerate("xyz")}
        columns |= {"temperature_c": self.temperature_c, "t_s": self.t_s, "n": np.full(N, 100.0)}
        columns |= {f"a{axis}_std": np.full(N, 10 * NOISE_G) for axis in "xyz"}
        return Table.from_columns("positions", columns, {"unit": "g"}, "hand-held")
