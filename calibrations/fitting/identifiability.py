"""Which parameters the data determine, and with what standard uncertainty.

A direction of the parameter space that changes nothing in the data is not identified, nor is a parameter whose
standard uncertainty is no smaller than what a sensor may typically show: the data then give no information about it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibrations.model import Estimate, Model
from calibrations.model.parameters import Layout, Slot
from calibrations.table import Array

ROUNDING = 1e-12  # a column shorter than this, relative to the longest, is zero
UNDETERMINED = 1e-6  # share of an entry's typical size that may change freely, squared
RELATIVE_RANK = 1e-8  # singular values below this, relative to the largest, are zero to rounding


def covariance(jacobian: Array, typical: Array) -> tuple[Array, Array]:
    """Covariance of the parameters from the whitened jacobian, and the undetermined directions.

    Returns ((p, p), (k, p)): the second an orthonormal basis, in units of `typical`, of what changes nothing.
    """
    _, root, null = _directions(jacobian, typical)
    return root @ root.T, np.linalg.qr(null.T)[0].T


def correlation_matrix(covariance: Array) -> Array:
    """The correlation matrix of a covariance matrix (p, p); NaN where a variance is 0 or unknown."""
    std = np.sqrt(np.diag(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(covariance / np.outer(std, std))


def gain(jacobian: Array, typical: Array) -> Array:
    """The pseudo-inverse (p, rows) of the whitened jacobian: the change of each parameter by a change of each row."""
    U, root, _ = _directions(jacobian, typical)
    return root @ U.T


def _directions(jacobian: Array, typical: Array) -> tuple[Array, Array, Array]:
    """The determined directions, as (rows, k) and (p, k) whose product is the gain, and the others, (p - k, p)."""
    scaled = jacobian * typical
    norm = np.linalg.norm(scaled, axis=0)
    norm = np.where(norm > ROUNDING * norm.max(), norm, 1.0)
    U, s, Vt = np.linalg.svd(scaled / norm, full_matrices=False)
    determined = s > RELATIVE_RANK * s[0]
    root = (Vt[determined].T / s[determined]) * (typical / norm)[:, None]
    return U[:, determined], root, Vt[~determined] / norm


def with_estimates(model: Model, layout: Layout, theta: Array, jacobian: Array, factors: Array) -> Model:
    """`model` with a value and a standard uncertainty for every parameter of `theta` (p,).

    The uncertainties are those of the whitened jacobian (rows, p) times `factors` (p,).
    """
    if not len(theta):
        return model
    cov, null = covariance(jacobian, layout.typical)
    std, free = factors * np.sqrt(np.diag(cov)), null.T @ null
    by_term: list[list[Estimate]] = [[] for _ in model.terms]
    for k, slot in enumerate(layout.slots):
        reason = _why_not(k, layout, std, free)
        unit = slot.parameter.unit.replace("{out}", layout.unit)
        uncertainty = None if free[k, k] > UNDETERMINED else float(std[k])
        by_term[slot.term].append(
            Estimate(slot.parameter.name, slot.axis, float(theta[k]), uncertainty, unit, reason is None, reason)
        )
    terms = tuple(replace(term, estimates=tuple(e)) for term, e in zip(model.terms, by_term, strict=True))
    return replace(model, terms=terms, correlations=None)  # those of earlier values


def _why_not(k: int, layout: Layout, std: Array, free: Array) -> str | None:
    """Why entry `k` is not identified, or None. `free`: the projector (p, p) on what changes nothing in the data.

    Two entries are separable where the projector has no element for them. It does not depend on the basis.
    """
    if free[k, k] > UNDETERMINED:
        share = np.diag(free)
        tied = (share > UNDETERMINED) & (np.abs(free[k]) > 1e-3 * np.sqrt(share[k] * share))
        partners = [_label(layout, s) for j, s in enumerate(layout.slots) if j != k and tied[j]]
        if not partners:
            return "it changes nothing in this data"
        return f"on this data it cannot be separated from {', '.join(partners)}"
    if std[k] >= layout.typical[k]:
        return (
            f"its standard uncertainty, {std[k]:.2g}, is not smaller than a typical value, {layout.typical[k]:.2g}; "
            "measure at more orientations"
        )
    return None


def _label(layout: Layout, slot: Slot) -> str:
    parts = (layout.model.terms[slot.term].name, slot.parameter.name, slot.axis)
    return " ".join(dict.fromkeys(filter(None, parts)))
