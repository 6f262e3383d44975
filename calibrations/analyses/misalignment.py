"""Directions of the sensing axes, estimated from the brackets of a search, with other effects on them.

In the frame that is turned to the bracket's centre, with beta counted from the sensing axis, an output is

    V = g . a + k_xx a_x^2 + k_yy a_y^2 + k_zz a_z^2 + p sin(beta) + q cos(alpha) cos(beta) + r cos^2(alpha) cos(beta)
      + s t + (v + w a_x) (supply - mean)                        a = (sin alpha cos beta, ..., cos alpha) in g

g / |g| is the axis. p, q: tilt of the base and zero offsets of the stages; p and r also contain hysteresis, because a
round approaches its poses from both sides; s: drift. The squares add up to 1, so they contain the bias. In a complete
round all columns except those of the supply are orthogonal to g. An effect that is linear in a load cannot be separated
from a rotation of the axis, whatever its cause, and is a part of the result.

The angles of a search for the extreme output give the directions, and these correct the acceleration:

    Theta_x = Ry(alpha_x) Rz(beta_x) [1 0 0]^T        Theta_y = Rx(alpha_y) Rz(beta_y) [0 1 0]^T

Two misprints of Ang (18)-(21) are corrected: x_ref is [1 0 0], not [0 0 1], and (20) subtracts theta_xy A_y, not
theta_yx A_y. The printed angles for y do not give the printed Theta_y.

Source  Ang (18)-(21); generalised least squares; noise as in `noise_fit`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError
from calibrations.fitting.noise_fit import estimate
from calibrations.geometry.orientation import rotation
from calibrations.means.noise import Noise, white_only, white_std
from calibrations.table import AXES, Array, Table


def search_angles_x(alpha_deg: float, beta_deg: float) -> tuple[float, float]:
    """(alpha_x, beta_x) in deg, from the stage angles at which the x output is greatest."""
    return alpha_deg - 90.0, beta_deg


def search_angles_y(alpha_deg: float, beta_deg: float) -> tuple[float, float]:
    """(alpha_y, beta_y) in deg, from the stage angles at which the y output is greatest."""
    return 90.0 - alpha_deg, beta_deg - 90.0


def along_reference(a: Array, x: Array, y: Array) -> Array:
    """Acceleration along the reference axes x and y, shape (n, 2), from `a` along the sensing axes, shape (n, 3).

    `x`, `y`: their directions Theta. To first order: x is corrected with the uncorrected y and z, y with the
    corrected x and the uncorrected z. Ang (20)-(21).
    """
    along_x = (a[:, 0] - x[1] * a[:, 1] - x[2] * a[:, 2]) / x[0]
    along_y = (a[:, 1] - y[0] * along_x - y[2] * a[:, 2]) / y[1]
    return np.column_stack([along_x, along_y])


def _rotation_about(axis: str, angle_deg: float) -> Array:
    """Rotation matrix about an axis of the reference frame, shape (3, 3)."""
    return rotation(np.radians(angle_deg) * np.eye(3)[AXES.index(axis)])


Rows = NDArray[np.intp]
RowMask = NDArray[np.bool_]

TURN = "turn"
AXIS_DEG = {"x": 0.0, "y": 90.0}  # beta of the extreme of an axis that is not misaligned
ANGLES = {"x": search_angles_x, "y": search_angles_y}
ROUND_ROWS = 12  # that bracket one axis


@dataclass(frozen=True)
class Direction:
    """A sensing axis: unit vector `theta` in the reference frame, its covariance (3, 3), from `rounds` rounds."""

    axis: str
    theta: Array
    covariance: Array
    rounds: int

    @property
    def angles_deg(self) -> Array:
        """(alpha, beta) of Ang's search: from the reference axis to the extreme, deg."""
        x, y, z = self.theta
        return np.array(ANGLES[self.axis](np.degrees(np.arccos(z)), np.degrees(np.arctan2(y, x))))

    @property
    def angles_covariance_deg2(self) -> Array:
        """Covariance of `angles_deg`, shape (2, 2)."""
        x, y, _ = self.theta
        radius_squared = x * x + y * y
        sign = 1.0 if self.axis == "x" else -1.0
        slope = np.degrees([[0, 0, -sign / np.sqrt(radius_squared)], [-y / radius_squared, x / radius_squared, 0]])
        return np.asarray(slope @ self.covariance @ slope.T)


def estimate_directions(table: Table) -> dict[str, Direction]:
    """Directions of x and of y, from the rounds about the last centre. Raises DataError where no round is complete."""
    number = np.array([_number(path) for path in table.labels.get("path", ())])
    if len(number) != table.n or not table.n:
        raise DataError(
            f"{table.source}: is not a misalignment run: the column path has no rounds; take a run of `misalignment`"
        )
    pose = np.column_stack([table.column("alpha_deg"), table.column("beta_deg")])
    rounds = [number == k for k in range(1, number.max() + 1)]
    complete = [rows for rows in rounds if rows.sum() == ROUND_ROWS + ROUND_ROWS // 3]
    if not complete:
        raise DataError(f"{table.source}: no round of the search is complete yet; resume the run")
    same_poses = [rows for rows in complete if np.array_equal(pose[rows], pose[complete[-1]])]
    brackets = [_bracket(table, axis, same_poses) for axis in AXIS_DEG]
    white = _is_white(brackets)
    return {b.axis: _direction(b, b.noise() if white else b.slow_noise()) for b in brackets}


def non_orthogonality_deg(x: Direction, y: Direction) -> tuple[float, float]:
    """90 deg minus the angle from x to y, deg, and its standard error."""
    cosine = float(x.theta @ y.theta)
    variance = y.theta @ x.covariance @ y.theta + x.theta @ y.covariance @ x.theta
    return float(np.degrees(np.arcsin(cosine))), float(np.degrees(np.sqrt(variance / (1 - cosine**2))))


def correction_matrix(x: Array, y: Array) -> Array:
    """The matrix of Ang (20)-(21), shape (2, 3): (A_xref, A_yref) = C (A_x, A_y, A_z); `x`, `y` are Theta."""
    return along_reference(np.eye(3), x, y).T


def _number(path: str) -> int:
    """The round that a pose belongs to; 0 for none."""
    word = path.rpartition(" ")[2]
    return int(word) if word.isdecimal() else 0


@dataclass(frozen=True)
class _Bracket:
    """The rows of one axis: regressors (n, p), loads first, its output and white noise (n,)."""

    axis: str
    centre_deg: float  # beta from which its columns count
    rounds: int
    columns: Array
    volts: Array
    white: Array | None
    gap_s: Array

    def noise(self) -> Noise:
        """White noise alone, from the samples of each dwell."""
        return white_only(None if self.white is None else self.white[None, :], self.gap_s, 1)

    def slow_noise(self) -> Noise:
        """White noise with the scatter and the slow noise of the residual."""
        residual = self.volts - self.columns @ np.linalg.lstsq(self.columns, self.volts, rcond=None)[0]
        return estimate(self.noise(), residual[None], self.columns[None], np.zeros((len(residual), 0)))

    def solved(self, noise: Noise) -> tuple[Array, Array, float]:
        """Factors of the columns (p,), their covariance (p, p), and the residual sum of squares."""
        whitened = noise.whiten(np.column_stack([self.columns, self.volts])[None])
        inverse = np.linalg.pinv(whitened[:, :-1])
        factors = inverse @ whitened[:, -1]
        residual = whitened[:, -1] - whitened[:, :-1] @ factors
        return factors, inverse @ inverse.T, float(residual @ residual)


def _bracket(table: Table, axis: str, rounds: list[RowMask]) -> _Bracket:
    paths = np.array([path.partition(" ")[0] for path in table.labels["path"]])
    rows = np.flatnonzero(np.any(rounds, axis=0) & np.isin(paths, (TURN, axis)))
    centre_deg = table.column("beta_deg")[np.flatnonzero(rounds[-1])[0]] + AXIS_DEG[axis]
    white, t_s = white_std(table), table.time_s[rows]
    return _Bracket(
        axis,
        centre_deg,
        len(rounds),
        _columns(table, rows, centre_deg),
        table.output(axis)[rows],
        None if white is None else white[rows, table.axes.index(axis)],
        np.diff(t_s, prepend=t_s[0]),
    )


def _is_white(brackets: list[_Bracket]) -> bool:
    """Whether white noise explains the residual of both axes, within one standard deviation of its chi-square.

    An estimate of slow noise where there is none would make the axes look less certain than they are.
    """
    if any(bracket.white is None for bracket in brackets):
        return False
    square = sum(bracket.solved(bracket.noise())[2] for bracket in brackets)
    free = sum(len(bracket.volts) - np.linalg.matrix_rank(bracket.columns) for bracket in brackets)
    return bool(square < free + np.sqrt(2 * free))


def _direction(bracket: _Bracket, noise: Noise) -> Direction:
    factors, covariance, _ = bracket.solved(noise)
    from_bracket, size = _rotation_about("z", bracket.centre_deg), float(np.linalg.norm(factors[:3]))
    theta = from_bracket @ factors[:3] / size
    slope = (np.eye(3) - np.outer(theta, theta)) @ from_bracket / size
    return Direction(bracket.axis, theta, slope @ covariance[:3, :3] @ slope.T, bracket.rounds)


def _columns(table: Table, rows: Rows, centre_deg: float) -> Array:
    """Regressors of an output, shape (n, 10), or two more with a measured supply; the loads are first."""
    a, b = np.radians(table.column("alpha_deg")[rows]), np.radians(table.column("beta_deg")[rows] - centre_deg)
    loads = np.column_stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
    sides = [np.sin(b), np.cos(a) * np.cos(b), np.cos(a) ** 2 * np.cos(b)]
    t_s = table.time_s[rows]
    slow = [(t_s - t_s.mean()) / max(np.ptp(t_s), 1.0)]
    if "supply_v" in table:
        supply_v = table.column("supply_v")[rows] - table.column("supply_v")[rows].mean()
        slow += [supply_v, supply_v * loads[:, 0]]
    return np.column_stack([loads, loads**2, *sides, *slow])
