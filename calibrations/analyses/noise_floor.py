"""The noise floor of a still record, as a voltage and as the inclination with the same change of output.

Source  Ang V: noise as 4 x rms peak to peak, and the angle with the same change of output.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibrations.errors import DataError
from calibrations.means.noise import autocovariance
from calibrations.table import Array

LONGEST_LAG = 0.02  # of a record: at longer lags an autocorrelation is mostly noise


def noise_rms(stretches: Sequence[Array]) -> tuple[float, float]:
    """(rms about the mean, its standard error) of stretches of samples, each of shape (n,).

    Filtered samples are correlated: n of them carry n / (1 + 2 sum rho_k^2) for the variance (Bartlett). Raises
    DataError for constant samples.
    """
    samples = np.concatenate(stretches)
    centred = samples - samples.mean()
    n, value = len(samples), float(centred.std(ddof=1)) if len(samples) > 1 else 0.0
    if not value:
        raise DataError("all samples of the still record are equal; check that the sensor is connected and powered")
    effective = n / (1 + 2 * float(np.sum(_autocorrelation(centred) ** 2)))
    return value, value / np.sqrt(2 * effective)


def _autocorrelation(centred: Array) -> Array:
    """rho_k from lag 1 to the first that is not significant, shape (lags,)."""
    n = len(centred)
    covariance = autocovariance(centred, max(2, int(LONGEST_LAG * n)))
    rho = covariance[1:] / covariance[0]
    insignificant = np.flatnonzero(rho < 2 / np.sqrt(n))
    return np.asarray(rho[: insignificant[0]] if len(insignificant) else rho)


def hidden_inclination_deg(peak_to_peak_v: float, scale_v_per_g: float) -> float:
    """The inclination of a horizontal axis whose change of output equals the noise. Ang V."""
    return float(np.degrees(np.arcsin(min(1.0, peak_to_peak_v / abs(scale_v_per_g)))))
