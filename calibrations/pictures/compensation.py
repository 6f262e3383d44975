"""A picture of a compensation: what the linear model leaves, and what the compensation does (Ang Fig. 12, at rest)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from calibrations.compensation.residual import Residual
from calibrations.numerals import plain
from calibrations.pictures.style import BLUE, MARKER, QUIET, VERMILION, panels, styled


@styled
def compensated(found: Residual) -> Figure:
    """A row for each axis: the linear model's error on the left, the compensated one beside it on the same scale."""
    figure, axes = panels(len(found.axes), 2, 2.6, sharex=True, sharey="row")
    poses = np.arange(found.table.n)
    for k, axis in enumerate(found.axes):
        for ax, errors, colour, name, rmse in zip(
            axes[k], (found.linear, found.compensated), (VERMILION, BLUE), ("linear model", "compensated"),
            found.rmse[axis], strict=True,
        ):  # fmt: skip
            ax.axhline(0.0, color=QUIET, lw=0.7)
            ax.plot(poses, errors[:, k], "o", ms=MARKER - 1, color=colour)
            ax.set_title(f"{axis}, {name}: rmse {plain(rmse)} mm/s²")
        axes[k, 0].set_ylabel("sensor less reference (mm/s²)")
    for ax in axes[-1]:
        ax.set_xlabel("pose")
    return figure
