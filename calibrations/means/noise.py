"""The noise of a table's means: white noise of known level, scatter, and slow noise.

    Sigma = W + k^2 I + (rho w)^2 G + sum s_j^2 G_j

per channel. W: the white variances of the means. k: scatter from row to row beyond the white noise. G: a Gauss-Markov
process, or flicker noise as a sum of them with time constants evenly spaced on a logarithmic scale; w the rms of white
noise and scatter. Where the white noise is not known, W is zero and k takes its place. `noise_fit` estimates these.
s_j, G_j: Gauss-Markov processes that are known from elsewhere, as from a still record of the same sensor
(`table_noise`); then no G is estimated.

The variance of a mean is that of n independent samples times an inflation 1 + 2 sum rho_k, with rho_k the correlation
over k samples. Where raw samples exist the inflation is measured; a table carries it as the constants
`noise_inflation_x`, ... Otherwise samples behind a first-order low-pass are correlated by rho = exp(-2 pi f_corner /
f_sample) from one to the next, so that it is (1 + rho) / (1 - rho).

Source  Madras and Sokal, J. Stat. Phys. 50 (1988), and Wolff, Comput. Phys. Commun. 156 (2004): the inflation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtri  # scipy.stats takes 0.4 s to load

from calibrations.criteria import LEAST_NOISE, NO_SCATTER, SIGNIFICANT
from calibrations.means.kernels import whiten, whiten_transposed
from calibrations.table import Array, Table, std_column

Processes = tuple[tuple[float, float], ...]  # (standard deviation, time constant in s) of Gauss-Markov processes

BEYOND = 10.0  # lengths of a record: the longest time constants of flicker noise
MOST_CORRELATED_ROWS = 400  # rows that degrees of freedom are computed on
NORMAL_MEDIAN = 0.6745  # of the size of normal noise
DIFFERENCES_PER_ROW = 1.944  # second differences with the information of one independent row: 1 + 2 (16 + 1) / 36
SLOW_FREEDOM = 60.0  # as a process has whose time constant is a hundredth of the record


@dataclass(frozen=True)
class Noise:
    """Noise of each mean, in the residual's unit. `white` has shape (channels, n), the others are per channel."""

    white: Array
    gap_s: Array
    scatter: Array
    ratio: Array
    taus_s: tuple[tuple[float, ...], ...]  # time constants, per channel: one, or several for flicker noise
    given: tuple[Processes, ...] = ()  # per channel, known before the fit; empty if none is known
    reference: Array | None = None  # (channels,), what errors are counted in where the white noise is not known

    @property
    def known(self) -> bool:
        """Whether the white noise is known from the samples."""
        return bool(self.white.any())

    @cached_property
    def fast(self) -> Array:
        """White noise and scatter of each mean, shape (channels, n)."""
        return np.asarray(np.hypot(self.white, self.scatter[:, None]))

    @property
    def floor(self) -> Array:
        """The noise floor: the white noise of one mean, rms over rows; the reference or scatter where not known."""
        if self.known:
            return rms(self.white)
        return self.scatter if self.reference is None else self.reference

    @property
    def tau_s(self) -> Array:
        """The longest time constant of the slow noise, s."""
        return np.array([max(taus) for taus in self.taus_s])

    @cached_property
    def slow(self) -> Array:
        """Standard deviation of the slow noise that was estimated."""
        return self.ratio * rms(self.fast)

    @property
    def known_slow(self) -> Array:
        """Standard deviation of the known slow noise about its mean over these rows."""
        return np.array(
            [_about_mean(channel_processes, float(np.sum(self.gap_s))) for channel_processes in self.given]
            or [0.0] * len(self.ratio)
        )

    @property
    def wander(self) -> Array:
        """Standard deviation of all slow noise, estimated and known."""
        return np.asarray(np.hypot(self.slow, self.known_slow))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the noise: few for slow noise, because a record has few long times."""
        return SLOW_FREEDOM if np.any(self.slow > 0.1 * rms(self.fast)) else float(self.white.size)

    @cached_property
    def effective_rows(self) -> Array:
        """The number of independent rows with the same information on the noise, (channels,) (Satterthwaite)."""
        step = max(1, len(self.gap_s) // MOST_CORRELATED_ROWS)
        time_s = np.cumsum(self.gap_s)[::step]
        apart_s, rows = np.abs(time_s[:, None] - time_s), []
        for fast, slow, taus_s in zip(self.fast, self.slow, self.taus_s, strict=True):
            covariance = np.diag(fast[::step] ** 2) + slow**2 * np.mean(
                [np.exp(-apart_s / tau_s) for tau_s in taus_s], axis=0
            )
            squares = float(np.sum(covariance**2))
            rows.append(np.trace(covariance) ** 2 / squares if squares > 0 else len(time_s))
        return np.array(rows)

    def is_like(self, noise: Noise) -> bool:
        """Whether both weigh the rows alike, scatter within 1 % of the noise."""
        same_shape = np.array_equal(self.ratio, noise.ratio) and self.taus_s == noise.taus_s
        return same_shape and bool(np.all(np.abs(rms(self.fast) / rms(noise.fast) - 1) < 1e-2))

    def prolonged(self) -> Noise:
        """Flicker noise continues at times longer than a record: with time constants up to BEYOND times its length.

        What wanders so slowly looks like a bias in the record, which is then known no better than it wanders.
        """
        taus_s, ratio = list(self.taus_s), self.ratio.copy()
        for c, taus in enumerate(self.taus_s):
            if len(taus) > 1:
                step = taus[1] / taus[0]
                count = int(np.log(BEYOND * float(np.sum(self.gap_s)) / taus[-1]) / np.log(step))
                taus_s[c] = (*taus, *(taus[-1] * step**k for k in range(1, count + 1)))
                ratio[c] *= np.sqrt(len(taus_s[c]) / len(taus))
        return replace(self, ratio=ratio, taus_s=tuple(taus_s))

    def whiten(self, columns: Array) -> Array:
        """(channels, n, k) -> (channels * n, k), each row of unit variance and independent of the others."""
        return np.concatenate([self._whiten_channel(c, columns[c])[0] for c in range(len(columns))])

    def whiten_transposed(self, columns: Array) -> Array:
        """(channels, n, k), multiplied by the transpose of the matrix by which `whiten` multiplies each channel."""
        return np.stack(
            [
                whiten_transposed(
                    np.ascontiguousarray(channel_columns), self.gap_s, self.fast[c], *_arrays(self._processes(c))
                )
                for c, channel_columns in enumerate(columns)
            ]
        )

    def _whiten_channel(self, c: int, columns: Array) -> tuple[Array, float]:
        known_processes = self.given[c] if self.given else ()
        return whiten_columns(columns, self.gap_s, self.fast[c], float(self.slow[c]), self.taus_s[c], known_processes)

    def _processes(self, c: int) -> Processes:
        return processes(float(self.slow[c]), self.taus_s[c], self.given[c] if self.given else ())

    @cached_property
    def logdet(self) -> float:
        """log det Sigma over all channels."""
        no_columns = np.zeros((self.white.shape[1], 0))
        return sum(self._whiten_channel(c, no_columns)[1] for c in range(len(self.white)))


def whiten_columns(
    columns: Array, gap_s: Array, fast: Array, slow: float, taus_s: tuple[float, ...], known_noise: Processes = ()
) -> tuple[Array, float]:
    """Columns (n, k) of one channel made white, and log det Sigma."""
    whitened, logdet = whiten(
        np.ascontiguousarray(columns), gap_s, fast, *_arrays(processes(slow, taus_s, known_noise))
    )
    return whitened, float(logdet)


def processes(slow: float, taus_s: tuple[float, ...], known_noise: Processes = ()) -> Processes:
    """The processes of slow noise with a standard deviation, in equal shares, and the given processes."""
    std = slow / len(taus_s) ** 0.5
    return (*((std, tau_s) for tau_s in taus_s if slow or not known_noise), *known_noise)


def _arrays(processes: Processes) -> tuple[Array, Array]:
    """Standard deviations and time constants."""
    stds, times_s = (np.array(values) for values in zip(*processes, strict=True))
    return stds, times_s


def _about_mean(processes: Processes, span_s: float) -> float:
    """Standard deviation of processes about their mean over a time."""
    if not span_s:
        return 0.0
    shares = [(std**2, tau_s / span_s) for std, tau_s in processes]
    return float(np.sqrt(sum(v * (1 - 2 * x + 2 * x * x * -np.expm1(-1 / x)) for v, x in shares)))


def rms(x: Array) -> Array:
    """Root mean square along the last axis."""
    return np.asarray(np.sqrt(np.mean(x * x, axis=-1)))


def robust_std(deviations: Array, axis: int | None = None) -> Array:
    """Robust standard deviation from `deviations` from their centre, along `axis` or of all.

    By the median absolute deviation, Huber and Ronchetti, Robust Statistics (2009), chapter 5.
    """
    return np.asarray(np.median(np.abs(deviations), axis=axis) / NORMAL_MEDIAN)


def neighbour_std(rows: Array) -> Array:
    """Noise of rows (channels, n) in order of time, from the median of their second differences, (channels,)."""
    return np.asarray(np.median(np.abs(_second_differences(rows)), axis=1) / NORMAL_MEDIAN)


def neighbours_contradict(whitened: Array) -> bool:
    """Whether whitened residuals (channels, n), in order of time, differ by clearly less than white noise of 1.

    Slow noise and missing effects add to the differences, so that smaller ones always show that the noise is less.
    """
    differences = _second_differences(whitened)
    freedom = differences.size / DIFFERENCES_PER_ROW
    squares = float(np.sum(differences**2)) / DIFFERENCES_PER_ROW
    return squares < min(LEAST_NOISE**2 * freedom, float(chdtri(max(freedom, 1.0), 1 - SIGNIFICANT)))


def _second_differences(rows: Array) -> Array:
    """Second differences (channels, n - 2) of unit variance where the rows are white noise of unit variance."""
    return np.asarray((rows[:, 2:] - 2 * rows[:, 1:-1] + rows[:, :-2]) / np.sqrt(6.0))


def white_only(white: Array | None, gap_s: Array, channels: int, known_noise: tuple[Processes, ...] = ()) -> Noise:
    """The noise before a fit."""
    unit_scale = np.ones(channels)
    if white is None:
        return Noise(
            np.zeros((channels, len(gap_s))), gap_s, unit_scale, 0 * unit_scale, ((1.0,),) * channels, known_noise
        )
    return Noise(white, gap_s, 0 * unit_scale, 0 * unit_scale, ((1.0,),) * channels, known_noise)


WINDOW = 6.0  # lags summed, at least, and in correlation times: exp(-6) of an exponential's sum is left out


def white_std(table: Table) -> Array | None:
    """Standard deviation of each mean, in the output's unit, shape (n, axes); None where it is not known.

    If a coarse converter gave all samples of a mean one code, their noise is unknown: that of the other means is used.
    """
    if all(_noise_name(name) in table for name in table.output_names):
        return np.column_stack([table.column(_noise_name(name)) for name in table.output_names])
    names = list(table.std_names)
    if "n" not in table or not all(name in table for name in names):
        return None
    std = np.column_stack([table.column(name) for name in names])
    scattered = std > 0
    if not scattered.any(axis=0).all():
        return None
    usual = np.array([np.median(x[is_scattered]) for x, is_scattered in zip(std.T, scattered.T, strict=True)])
    std = np.where(std > NO_SCATTER * usual, std, usual)
    factors = np.array([inflation(table, axis) for axis in table.axes])
    mean: Array = std * np.sqrt(factors / table.column("n")[:, None])
    return mean


def with_white(table: Table, white: Array) -> Table:
    """The table with the white noise of each mean by a residual, shape (axes, n)."""
    names = map(_noise_name, table.output_names)
    return replace(table, columns={**table.columns, **dict(zip(names, white, strict=True))})


def norm_std(table: Table, std: Array) -> Array:
    """Standard deviation of each mean's magnitude, in the output's unit, shape (n, 1); `std` is that of the axes."""
    if "norm_std" in table:
        return (table.column("norm_std") * np.sqrt(inflation(table) / table.column("n")))[:, None]
    centre = (table.outputs.max(axis=0) + table.outputs.min(axis=0)) / 2
    unit_vectors = table.outputs - centre
    unit_vectors = unit_vectors / np.linalg.norm(unit_vectors, axis=1, keepdims=True)
    return np.asarray(np.sqrt(np.sum((unit_vectors * std) ** 2, axis=1, keepdims=True)))


def inflation(table: Table, axis: str = "") -> float:
    """Ratio of the variance of a mean to that of independent samples.

    It is that measured on the samples of `axis`, else that of the table's filter; 1 if corner or rate is not given.
    """
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


def most_scatter(table: Table) -> float:
    """The most by which means can scatter more than their samples say: those of n fully correlated samples, sqrt(n).

    1 if the correlation is known.
    """
    return 1.0 if correlation_known(table) else float(np.sqrt(np.median(table.column("n"))))


def measured_inflation(blocks: Array) -> tuple[Array, Array]:
    """The inflation of each channel and its standard error, shape (channels,).

    `blocks` has shape (blocks, n, channels); each is taken about its own mean. The sum ends at the first lag beyond
    WINDOW correlation times (Madras and Sokal, 1988); what the unknown means take away is given back (Wolff, 2004).
    NaN for a channel without noise, and where the correlation lasts too long for blocks of n samples.
    """
    n = blocks.shape[1]
    lags = n // 4 + 1
    covariance = np.mean([autocovariance(block.T, lags) for block in blocks], axis=0) * n / (n - np.arange(lags))
    factor, last = (np.array(values) for values in zip(*(_sum_autocovariance(c, n) for c in covariance), strict=True))
    return factor, factor * np.sqrt(2 * (2 * last + 1) / (len(blocks) * n))


def autocovariance(x: Array, lags: int) -> Array:
    """Autocovariance of values (..., n), at lags 0 .. lags - 1: sums of products divided by n, shape (..., lags)."""
    n = x.shape[-1]
    size = 1 << (n + lags - 1).bit_length()  # no lag that is used wraps round
    spectrum = np.fft.rfft(x - x.mean(axis=-1, keepdims=True), size)
    return np.asarray(np.fft.irfft(spectrum.real**2 + spectrum.imag**2, size)[..., :lags] / n)


def _sum_autocovariance(covariance: Array, n: int) -> tuple[float, int]:
    """Inflation from one channel's autocovariance, and the last lag that is in it."""
    if not covariance[0] > 0:
        return float("nan"), 0
    sums = 2 * np.cumsum(covariance) - covariance[0]
    past_window = np.flatnonzero(np.arange(len(sums)) >= WINDOW * np.maximum(1.0, sums / covariance[0] / 2))
    if not len(past_window):
        return float("nan"), 0
    last = int(past_window[0])
    true = sums[last] / (1 - (2 * last + 1) / n)  # each lag has lost true / n by the block's mean
    return float(true / (covariance[0] + true / n)), last


def _noise_name(output: str) -> str:
    return f"{std_column(output)}_of_mean"
