"""What the model leaves: residual against angle, time and temperature, beside the noise floor."""

from __future__ import annotations

from matplotlib.figure import Figure

from calibrations.fit import Fit
from calibrations.pictures.columns import columns, label_column
from calibrations.pictures.style import floor_band, panels, styled
from calibrations.pictures.view import dots, groups, key, label_residual, row_height


@styled
def picture(fit: Fit) -> Figure:
    """A row of panels for each axis, a column for each thing that the residual may follow."""
    across, found = columns(fit), groups(fit)
    figure, axes = panels(len(fit.channels), len(across), row_height(fit), sharex="col", sharey="row")
    for c in range(len(fit.channels)):
        for k, (ax, column) in enumerate(zip(axes[c], across, strict=True)):
            floor_band(ax, 1e3 * float(fit.noise.floor[c]))
            for group in found:
                dots(ax, group, column.values[c, group.rows], 1e3 * fit.residual[c, group.rows])
            label_residual(ax, fit, c, last=k == len(across) - 1)
            label_column(ax, column, c, last=c == len(fit.channels) - 1)
    key(figure, found)
    return figure
