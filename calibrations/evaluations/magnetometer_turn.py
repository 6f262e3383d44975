"""Full turns of a magnetometer, each with an edge upright: by hand with their extremes; the elements of the field.

The calibrated outputs, turned back by what is known of the stages and the mount, are the field in the frame of the rig:
x along its base, z upward. Its elements are those of `field.py` with X = x, Y = -y, Z = -z. D is then no declination,
but the azimuth from the base's x axis, clockwise seen from above: where that axis points is the laboratory's to say.

Outputs of one turn err together, by how the sensor sits in its mount: uncertainties are from the scatter of the turns.

Source  Book 17.4-17.5, (17.6)-(17.15).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibrations import field
from calibrations.evaluations.horizontal_turn import UNSEEN, Ellipse, ellipse, hard_iron
from calibrations.table import Array

FEWEST = 2  # turns that tell how well they agree


@dataclass(frozen=True)
class Elements:
    """F and H in the unit of the field, D and I in deg; standard uncertainties, None where one turn is all there is."""

    value: Mapping[str, float]
    std: Mapping[str, float | None]


@dataclass(frozen=True)
class ByHand:
    """Hard iron of each axis that was turned in the plane, NaN of the others, (3,); soft iron of the turn about z."""

    hard_iron: Array
    hard_iron_std: Array
    soft_iron: Ellipse
    left_per_mille: float  # that the magnitude of all turns varies by afterwards


def elements(sensed: Array, sensor_from_base: Array, turns: Sequence[str]) -> Elements:
    """From a calibrated field (n, 3) at known attitudes (n, 3, 3); `turns` names the turn of each row."""
    in_base = np.einsum("nij,ni->nj", sensor_from_base, sensed)
    names = np.array(turns)
    means = np.array([in_base[names == turn].mean(axis=0) for turn in dict.fromkeys(turns)])
    value = _of_field(means.mean(axis=0))
    if len(means) < FEWEST:
        return Elements(value, dict.fromkeys(value))
    covariance = np.cov(means.T) / len(means)
    step = 1e-4 * value["F"]
    stds = {}
    for name in value:
        ahead, behind = (
            np.array([_of_field(means.mean(axis=0) + side * step * e)[name] for e in np.eye(3)]) for side in (1, -1)
        )
        slope = (ahead - behind) / (2 * step)
        stds[name] = float(np.sqrt(slope @ covariance @ slope))
    return Elements(value, stds)


def level_by_hand(outputs: Array, sensor_from_base: Array, turn_std_deg: float | None) -> Elements:
    """H and D of a horizontal turn alone, (n, 3) at known attitudes (n, 3, 3), corrected by its own extremes.

    H is of the size that the least radius has (17.15), and uncertain by what iron makes of a field that the plane does
    not show. How the sensor sits in its mount is in D and does not show in one turn: `turn_std_deg`, from turn to turn,
    where several were made.
    """
    level = outputs[:, :2] - hard_iron(outputs[:, :2])
    round_z = ellipse(level)
    level = np.column_stack([level @ round_z.correction, np.zeros(len(level))])
    in_base = np.einsum("nij,ni->nj", sensor_from_base, level)
    found = _of_field(in_base.mean(axis=0))
    along = np.radians([found["D"], found["D"] + 90])
    std = [float((in_base[:, :2] @ [np.cos(a), -np.sin(a)]).std(ddof=1) / np.sqrt(len(level))) for a in along]
    h_std = float(np.hypot(std[0], UNSEEN * round_z.flattening * found["H"]))
    d_std = None if turn_std_deg is None else float(np.hypot(np.degrees(std[1] / found["H"]), turn_std_deg))
    return Elements({k: found[k] for k in "HD"}, {"H": h_std, "D": d_std})


def by_hand(outputs: Array, edges: Sequence[str], turns: Sequence[str], std: float) -> ByHand:
    """From raw outputs (n, 3) of turns about the edge of each row, `std` that of one of them; z first.

    Two turns about an edge are one and one turned over.
    """
    edge, turn = np.array(edges), np.array(turns)
    about_z = outputs[turn == turn[np.argmax(edge == "z")]][:, :2]
    round_z = ellipse(about_z - hard_iron(about_z))
    names = list(dict.fromkeys(turns))
    middles, unseen = np.full((2, len(names), 3), np.nan)
    for k, name in enumerate(names):
        rows, mine = turn == name, edge[turn == name][0]
        level = [axis for axis, letter in enumerate("xyz") if letter != mine]
        middles[k, level] = hard_iron(outputs[rows][:, level])
        unseen[k, level] = (
            0.0 if len(set(turn[edge == mine])) > 1 else _let_in(outputs[rows], "xyz".index(mine), round_z)
        )
    count = np.sum(np.isfinite(middles), axis=0)
    known, least = count > 0, np.maximum(count, 1)
    middle = np.where(known, np.nansum(middles, axis=0) / least, np.nan)
    by_noise, by_iron = std / np.sqrt(2 * least), np.sqrt(np.nansum(unseen**2, axis=0)) / least  # half of a sum of two
    middle_std = np.where(known, np.hypot(by_noise, by_iron), np.nan)
    return ByHand(middle, middle_std, round_z, _left_per_mille(outputs, middle, round_z, about_z))


def _let_in(outputs: Array, upright: int, round_z: Ellipse) -> float:
    """Standard uncertainty by what iron lets of the upright field into the level axes of a turn, (n, 3)."""
    return float(UNSEEN * round_z.flattening * abs(outputs[:, upright].mean()))


def horizontal_per_mille(xy: Array) -> float:
    """By how much the magnitude of a horizontal field (n, 2) varies."""
    size = np.linalg.norm(xy, axis=1)
    return float(1e3 * size.std() / size.mean())


def _left_per_mille(outputs: Array, middle: Array, round_z: Ellipse, about_z: Array) -> float:
    """Of the whole sphere where hard iron is known of every axis; else of the turn about z."""
    if not np.isfinite(middle).all():
        return horizontal_per_mille((about_z - hard_iron(about_z)) @ round_z.correction)
    away = outputs - middle
    size = np.linalg.norm(np.column_stack([away[:, :2] @ round_z.correction, away[:, 2:]]), axis=1)
    return float(1e3 * size.std() / size.mean())


def _of_field(base: Array) -> dict[str, float]:
    x, y, z = base[0], -base[1], -base[2]
    found = {
        "F": field.total(x, y, z),
        "H": field.horizontal(x, y),
        "D": field.declination_deg(x, y),
        "I": field.inclination_deg(x, y, z),
    }
    return {name: float(each) for name, each in found.items()}
