"""The white noise of a mean of correlated samples.

Its variance is that of n independent samples times an inflation 1 + 2 sum rho_k, with rho_k the correlation over k
samples. Where raw samples exist the inflation is measured; a table carries it as the constants `noise_inflation_x`, ...
Else samples behind a first-order low-pass are correlated by rho = exp(-2 pi f_corner / f_sample) from one to the next,
so that it is (1 + rho) / (1 - rho).
"""

from __future__ import annotations

import numpy as np

from calibrations.criteria import NO_SCATTER
from calibrations.table import Array, Table

WINDOW = 6.0  # lags summed, at least, and in correlation times: exp(-6) of an exponential's sum is left out


def white_std(table: Table) -> Array | None:
    """Standard deviation of each mean, in the output's unit, shape (n, axes); None where it is not known.

    Samples that a coarse converter all gave one code say nothing of their noise: it is taken as that of the others.
    """
    names = [_std_name(name) for name in table.output_names]
    if "n" not in table or not all(name in table for name in names):
        return None
    std = np.column_stack([table.column(name) for name in names])
    usual = np.median(std, axis=0)
    if not np.all(usual > 0):
        return None
    std = np.where(std > NO_SCATTER * usual, std, usual)
    factors = np.array([inflation(table, axis) for axis in table.axes])
    mean: Array = std * np.sqrt(factors / table.column("n")[:, None])
    return mean


def norm_std(table: Table, std: Array) -> Array:
    """Standard deviation of each mean's magnitude, in the output's unit, shape (n, 1); `std` is that of the axes."""
    if "norm_std" in table:
        return (table.column("norm_std") * np.sqrt(inflation(table) / table.column("n")))[:, None]
    centre = (table.outputs.max(axis=0) + table.outputs.min(axis=0)) / 2
    along = table.outputs - centre
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(np.sqrt(np.sum((along * std) ** 2, axis=1, keepdims=True)))


def inflation(table: Table, axis: str = "") -> float:
    """As measured on the samples of `axis`, else that of the table's filter; 1 where corner or rate is not given."""
    if (measured := f"noise_inflation_{axis}") in table.constants:
        return table.number(measured, 1.0)
    if "filter_corner_hz" not in table.constants or "sample_rate_hz" not in table.constants:
        return 1.0
    rho = np.exp(-2 * np.pi * table.number("filter_corner_hz", 0.0) / table.number("sample_rate_hz", 1.0))
    return float((1 + rho) / (1 - rho))


def correlation_known(table: Table) -> bool:
    """Whether the inflation follows from the samples, or from filter and rate; single samples need none.

    Else means are taken as those of independent samples, and their noise may be more than that.
    """
    measured = any(name.startswith("noise_inflation") for name in table.constants)
    filtered = "filter_corner_hz" in table.constants and "sample_rate_hz" in table.constants
    return measured or filtered or "n" not in table or bool(np.all(table.column("n") == 1))


def measured_inflation(blocks: Array) -> tuple[Array, Array]:
    """The inflation of each channel and its standard error, shape (channels,).

    `blocks` has shape (blocks, n, channels); each is taken about its own mean. The sum ends at the first lag beyond
    WINDOW correlation times (Madras and Sokal, 1988); what the unknown means take away is given back (Wolff, 2004).
    NaN for a channel without noise, and where the correlation lasts too long for blocks of n samples.
    """
    covariance = _autocovariance(blocks)
    found = [_summed(c, blocks.shape[1]) for c in covariance.T]
    factor, lags = (np.array(each) for each in zip(*found, strict=True))
    return factor, factor * np.sqrt(2 * (2 * lags + 1) / (blocks.shape[0] * blocks.shape[1]))


def _autocovariance(blocks: Array) -> Array:
    """Mean over the blocks, at lags 0 .. n // 4, shape (lags, channels)."""
    count, n, channels = blocks.shape
    lags = n // 4 + 1
    size = 1 << (n + lags - 1).bit_length()  # no lag that is used wraps round
    power = np.zeros((channels, size // 2 + 1))
    for block in blocks:
        spectrum = np.fft.rfft((block - block.mean(axis=0)).T, size)
        power += spectrum.real**2 + spectrum.imag**2
    products = np.fft.irfft(power, size)[:, :lags]
    return np.asarray((products / (count * (n - np.arange(lags)))).T)


def _summed(covariance: Array, n: int) -> tuple[float, int]:
    """Inflation from one channel's autocovariance, and the last lag that is in it."""
    if not covariance[0] > 0:
        return float("nan"), 0
    sums = 2 * np.cumsum(covariance) - covariance[0]
    beyond = np.flatnonzero(np.arange(len(sums)) >= WINDOW * np.maximum(1.0, sums / covariance[0] / 2))
    if not len(beyond):
        return float("nan"), 0
    last = int(beyond[0])
    true = sums[last] / (1 - (2 * last + 1) / n)  # each lag has lost true / n by the block's mean
    return float(true / (covariance[0] + true / n)), last


def _std_name(output: str) -> str:
    """`vx_v` -> `vx_std_v`, `ax` -> `ax_std`."""
    return output.replace("_v", "_std_v") if output.endswith("_v") else f"{output}_std"
