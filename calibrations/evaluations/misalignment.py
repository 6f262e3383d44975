"""The directions of the sensing axes from a search for the extreme output, and the correction that they call for.

    Theta_x = Ry(alpha_x) Rz(beta_x) [1 0 0]^T        Theta_y = Rx(alpha_y) Rz(beta_y) [0 1 0]^T

Ang (18)-(21), with two misprints set right: x_ref is [1 0 0], not [0 0 1], and (20) subtracts theta_xy A_y, not
theta_yx A_y. The angles printed for y do not give the Theta_y printed beside them; a test keeps both facts.
"""

from __future__ import annotations

import numpy as np

from calibrations.table import Array


def search_angles_x(alpha_deg: float, beta_deg: float) -> tuple[float, float]:
    """(alpha_x, beta_x) in deg, from the stage angles at which the x output is greatest."""
    return alpha_deg - 90.0, beta_deg


def search_angles_y(alpha_deg: float, beta_deg: float) -> tuple[float, float]:
    """(alpha_y, beta_y) in deg, from the stage angles at which the y output is greatest."""
    return 90.0 - alpha_deg, beta_deg - 90.0


def theta_x(alpha_x_deg: float, beta_x_deg: float) -> Array:
    """Direction of the x sensing axis in the reference frame, a unit vector, shape (3,). Ang (18)."""
    return np.asarray(_about_y(alpha_x_deg) @ _about_z(beta_x_deg) @ [1.0, 0.0, 0.0])


def theta_y(alpha_y_deg: float, beta_y_deg: float) -> Array:
    """Direction of the y sensing axis in the reference frame, a unit vector, shape (3,). Ang (19)."""
    return np.asarray(_about_x(alpha_y_deg) @ _about_z(beta_y_deg) @ [0.0, 1.0, 0.0])


def along_reference(a: Array, x: Array, y: Array) -> Array:
    """Acceleration along the reference axes x and y, shape (n, 2), from `a` along the sensing axes, shape (n, 3).

    `x`, `y`: their directions Theta. To first order: x is corrected with the uncorrected y and z, y with the
    corrected x and the uncorrected z. Ang (20)-(21).
    """
    along_x = (a[:, 0] - x[1] * a[:, 1] - x[2] * a[:, 2]) / x[0]
    along_y = (a[:, 1] - y[0] * along_x - y[2] * a[:, 2]) / y[1]
    return np.column_stack([along_x, along_y])


def _about_x(angle_deg: float) -> Array:
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _about_y(angle_deg: float) -> Array:
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _about_z(angle_deg: float) -> Array:
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
