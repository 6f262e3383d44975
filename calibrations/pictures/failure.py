"""Where the model fails: a map of the mean residual over both stage angles, in multiples of the noise floor.

One map for each direction of turning, as the mean over both would hide hysteresis. For positions, whose stage angles
are not known, the two half spheres of directions that gravity came from, in an equal-area map (Lambert).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from calibrations.fit import Fit
from calibrations.pictures import motion
from calibrations.pictures.columns import specific_force
from calibrations.pictures.style import INK, QUIET, SIGNED, panels, quarters, styled
from calibrations.pictures.view import dots, groups, key
from calibrations.table import Array

WORDS = {1: "clockwise", -1: "anticlockwise", 0: ""}
MOST_COLUMNS = 90  # of distinct beta; more are brought together


@styled
def picture(fit: Fit) -> Figure:
    """A row of maps for each axis; for a motion the residual over one period."""
    if fit.table.kind == "motion":
        return motion.failure(fit)
    if fit.table.kind == "rates":
        return _rates(fit)
    return _poses(fit) if fit.table.kind == "poses" else _positions(fit)


def _poses(fit: Fit) -> Figure:
    sides = list(_sides(fit))
    alphas = np.unique(fit.table.column("alpha_deg"))
    height = min(6.0, 0.9 + 0.24 * len(alphas))
    figure, axes = panels(len(fit.channels), len(sides), height, sharex=True, sharey=True)
    norm = _norm(fit.residual / fit.noise.floor[:, None])
    for c, name in enumerate(fit.channels):
        for ax, (side, rows) in zip(axes[c], sides, strict=True):
            edges, cells = mean_cells(fit, c, rows, alphas)
            steps = np.arange(len(alphas) + 1) - 0.5
            mesh = ax.pcolormesh(edges, steps, cells, cmap=SIGNED, norm=norm, rasterized=True)
            ax.grid(visible=False)
            ax.set_title(f"axis {name}{', ' if WORDS[side] else ''}{WORDS[side]}")
            ax.set_yticks(range(len(alphas)), [f"{value:g}" for value in alphas])
            quarters(ax)
        axes[c, 0].set_ylabel("α (deg)")
    for ax in axes[-1]:
        ax.set_xlabel("β (deg)")
    figure.colorbar(mesh, ax=axes, label="mean residual / noise floor", aspect=30, pad=0.01)
    return figure


def _sides(fit: Fit) -> Iterator[tuple[int, NDArray[np.intp]]]:
    direction = np.sign(fit.table.optional("direction", 0.0))
    for side in (1, -1, 0):
        rows = np.flatnonzero(direction == side)
        if len(rows):
            yield side, rows


def mean_cells(fit: Fit, c: int, rows: NDArray[np.intp], alphas: Array) -> tuple[Array, Array]:
    """(edges of beta, mean residual over noise floor of shape (alphas, betas)); NaN where nothing was measured."""
    beta = fit.table.column("beta_deg")
    grid = np.unique(np.round(beta, 3))
    if len(grid) > MOST_COLUMNS:
        grid = np.linspace(grid[0], grid[-1], MOST_COLUMNS)
    between = (grid[1:] + grid[:-1]) / 2
    edges = np.concatenate([[2 * grid[0] - between[0]], between, [2 * grid[-1] - between[-1]]]) if len(
        between) else grid[0] + np.array([-5.0, 5.0])  # fmt: skip
    where = (np.searchsorted(alphas, fit.table.column("alpha_deg")[rows]), np.searchsorted(between, beta[rows]))
    total, count = np.zeros((len(alphas), len(grid))), np.zeros((len(alphas), len(grid)))
    np.add.at(total, where, fit.residual[c, rows] / fit.noise.floor[c])
    np.add.at(count, where, 1.0)
    return edges, np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)


def _norm(values: Array) -> Normalize:
    """The same reach on both sides, at least 3 x the noise floor, so that noise alone stays pale."""
    reach = max(3.0, float(np.max(np.abs(values))))
    return Normalize(-reach, reach)


def _rates(fit: Fit) -> Figure:
    figure, axes = panels(1, len(fit.channels), 3.6, sharey=True)
    over, rate = fit.residual / fit.noise.floor[:, None], fit.table.column("rate_deg_s")
    for c, ax in enumerate(axes[0]):
        ax.axhspan(-1, 1, color=QUIET, alpha=0.2, lw=0)
        for group in groups(fit):
            dots(ax, group, rate[group.rows], over[c, group.rows])
        ax.set(title=f"axis {fit.channels[c]}", xlabel="rate (deg/s)")
    axes[0, 0].set_ylabel("residual / noise floor")
    key(figure, groups(fit))
    return figure


def _positions(fit: Fit) -> Figure:
    unit = "share of the field" if fit.table.content == "fields" else "g"
    figure, axes = panels(1, 2, 4.6, sharey=True)
    figure.set_layout_engine("compressed")
    x, y, z = specific_force(fit).T
    over = fit.residual[0] / fit.noise.floor[0]
    turn = np.linspace(0, 2 * np.pi, 121)
    for ax, side, word in zip(axes[0], (z >= 0, z < 0), ("upwards", "downwards"), strict=True):
        shrink = 1 / np.sqrt(1 + np.abs(z[side]))
        ax.plot(np.cos(turn), np.sin(turn), color=QUIET, lw=0.7)
        found = ax.scatter(x[side] * shrink, y[side] * shrink, c=over[side], cmap=SIGNED, norm=_norm(over), s=60,
                           edgecolors=INK, linewidths=0.6, clip_on=False)  # fmt: skip
        ax.set(title=f"z {word}", aspect="equal", xlim=(-1.1, 1.1), ylim=(-1.1, 1.1))
        ax.set(xticks=[-1, 0, 1], yticks=[-1, 0, 1], xlabel=f"towards x ({unit}, equal-area map)")
    axes[0, 0].set_ylabel(f"towards y ({unit}, equal-area map)")
    figure.colorbar(found, ax=axes, label="residual / noise floor", aspect=30, pad=0.01)
    return figure
