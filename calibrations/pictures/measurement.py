"""Measurement beside model: the output over beta, a curve for each inclination; |a| over time for positions; the
output over a few periods for a motion.

Dots are measured, lines are the model. Clockwise and anticlockwise lines differ where the model knows hysteresis.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from calibrations.compare import scales
from calibrations.fit import Fit
from calibrations.pictures import motion
from calibrations.pictures.columns import columns
from calibrations.pictures.style import INK, QUIET, beside, panels, quarters, styled
from calibrations.pictures.view import dots, groups, key


@styled
def picture(fit: Fit) -> Figure:
    """A panel for each axis, output in the table's unit on the left and in g on the right."""
    if fit.table.kind == "motion":
        return motion.measurement(fit)
    if fit.table.kind == "rates":
        return _rates(fit)
    return _poses(fit) if fit.table.kind == "poses" else _positions(fit)


def _poses(fit: Fit) -> Figure:
    n = len(fit.channels)
    figure, axes = panels(1, n, 4.2) if n < 3 else panels(n, 1, 3.0)
    beta, measured = fit.table.column("beta_deg"), fit.table.outputs.T
    for c, ax in enumerate(axes.flat):
        for group in groups(fit):
            rows = group.rows[np.argsort(beta[group.rows], kind="stable")]
            ax.plot(beta[rows], (measured - fit.residual)[c, rows], color=group.colour, zorder=1.5)
            dots(ax, group, beta[rows], measured[c, rows])
        ax.set(title=f"axis {fit.channels[c]}", xlabel="β (deg)", ylabel=f"output ({fit.table.unit})")
        quarters(ax)
        beside(ax, float(scales(fit)[c]), zero(fit, c), "output in g, by bias and scale factor")
    key(figure, groups(fit))
    return figure


def _rates(fit: Fit) -> Figure:
    """Output over the rate of the turn: dots measured, crosses by the model, as rows share no curve."""
    figure, axes = panels(1, len(fit.channels), 4.2)
    rate, measured = fit.table.column("rate_deg_s"), fit.table.outputs.T
    for c, ax in enumerate(axes.flat):
        for group in groups(fit):
            dots(ax, group, rate[group.rows], measured[c, group.rows])
        ax.plot(rate, (measured - fit.residual)[c], "+", color=INK, ms=9, mew=0.8, zorder=3)
        ax.set(title=f"axis {fit.channels[c]}", xlabel="rate (deg/s)", ylabel=f"output ({fit.table.unit})")
    key(figure, groups(fit))
    return figure


def zero(fit: Fit, c: int) -> float:
    """The output at 0 g: the model's bias, else the middle of what was measured."""
    terms = [term for term in fit.model.terms if term.name == "bias"]
    values = {e.axis: e.value for term in terms for e in term.estimates}
    measured = fit.table.outputs[:, c]
    return float(values.get(fit.channels[c], (measured.max() + measured.min()) / 2))


def _positions(fit: Fit) -> Figure:
    figure, axes = panels(1, 1, 3.8)
    ax, at = axes[0, 0], columns(fit)[3]
    ax.axhline(1.0, color=INK, lw=1.1, zorder=1)
    for group in groups(fit):
        rows = group.rows
        line = dots(ax, group, at.values[0, rows], 1.0 + fit.residual[0, rows])
        ax.errorbar(line.get_xdata(), line.get_ydata(), fit.noise.white[0, rows], fmt="none", ecolor=QUIET, lw=0.9)
    magnetic = fit.table.content == "fields"
    ax.set(title="magnitude of what the model makes of each position", xlabel=at.labels[0],
           ylabel="|m| (share of the field)" if magnetic else "|a| (g)")  # fmt: skip
    ax.annotate("the field" if magnetic else "gravity: 1 g", (1, 1.0), xycoords=("axes fraction", "data"),
                xytext=(-4, 4), textcoords="offset points", ha="right", color=INK)  # fmt: skip
    key(figure, groups(fit))
    return figure
