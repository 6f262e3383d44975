"""What a thing remembers of its way: play, the friction of Bouc and Wen, the relays of Preisach."""

from __future__ import annotations

import numpy as np

from tests.benchmark.discovery.layouts import Array


def trailing(drive: Array, half: float, held: float) -> Array:
    """What trails behind `drive` (n,) with a play of `half` to either side."""
    out, half = np.empty_like(drive), abs(half)
    for k, x in enumerate(drive):
        held = min(max(held, x - half), x + half)
        out[k] = held
    return out


def bouc_wen(way: Array, random: np.random.Generator) -> Array:
    """dz = (1 - |z|^n (g + b sign(dx z))) dx / reach; `way` (rows, stops, axes), z at each row's end (rows, axes)."""
    reach, power, b = random.uniform(0.03, 0.15), random.uniform(1.0, 1.6), random.uniform(0.5, 0.8)
    rows, stops, axes = way.shape
    steps = np.diff(way.reshape(-1, axes), axis=0, prepend=np.zeros((1, axes))) / reach
    z, out = np.zeros(axes), np.empty((rows, axes))
    for k, dx in enumerate(steps):
        z = np.clip(z + (1 - np.abs(z) ** power * (1 - b + b * np.sign(dx * z))) * dx, -1, 1)
        if k % stops == stops - 1:
            out[k // stops] = z
    return out


def preisach(way: Array, random: np.random.Generator) -> Array:
    """Relays that switch up above a threshold and down below a lower one, evenly over a strip of thresholds."""
    widths = random.uniform(0.02, 0.25) * np.array([0.6, 1.0, 1.5])
    centres = np.linspace(-1.2, 1.2, 401)
    up = (centres[:, None] + widths / 2).ravel()
    down = (centres[:, None] - widths / 2).ravel()
    rows, stops, axes = way.shape
    state = np.where(up[:, None] + down[:, None] < 0, 1.0, -1.0) * np.ones((1, axes))
    out = np.empty((rows, axes))
    for k, x in enumerate(way.reshape(-1, axes)):
        state[x >= up[:, None]] = 1.0
        state[x <= down[:, None]] = -1.0
        if k % stops == stops - 1:
            out[k // stops] = state.mean(axis=0)
    return out
