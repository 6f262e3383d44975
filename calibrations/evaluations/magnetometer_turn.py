"""Full turns of a magnetometer, each with an edge upright: by hand with their extremes; the elements of the field.

The calibrated outputs, turned back by what is known of the stages and the mount, are the field in the frame of the rig:
x along its base, z upward. Its elements are those of `field.py` with X = x, Y = -y, Z = -z, so that D is the angle from
the base's x axis, clockwise seen from above.

Outputs of one turn err together, by how the sensor sits in its mount: uncertainties are from the scatter of the turns.

Source  Book 17.4-17.5, (17.6)-(17.15).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibrations import field
from calibrations.evaluations.horizontal_turn import Ellipse, ellipse, hard_iron
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


def level_by_hand(outputs: Array, sensor_from_base: Array) -> Elements:
    """H and D of a horizontal turn alone, (n, 3) at known attitudes (n, 3, 3), corrected by its own extremes.

    Their uncertainties are from the scatter about the turn; H is of the size that the least radius has (17.15).
    """
    level = outputs[:, :2] - hard_iron(outputs[:, :2])
    level = np.column_stack([level @ ellipse(level).correction, np.zeros(len(level))])
    in_base = np.einsum("nij,ni->nj", sensor_from_base, level)
    found = _of_field(in_base.mean(axis=0))
    along = np.radians([found["D"], found["D"] + 90])
    std = [float((in_base[:, :2] @ [np.cos(a), -np.sin(a)]).std(ddof=1) / np.sqrt(len(level))) for a in along]
    return Elements({k: found[k] for k in "HD"}, {"H": std[0], "D": float(np.degrees(std[1] / found["H"]))})


def by_hand(outputs: Array, edges: Sequence[str], turns: Sequence[str], std: float) -> ByHand:
    """From raw outputs (n, 3) of turns about the edge of each row, `std` that of one of them; z first."""
    edge, turn = np.array(edges), np.array(turns)
    middles = np.full((len(set(turns)), 3), np.nan)
    for k, name in enumerate(dict.fromkeys(turns)):
        rows = turn == name
        level = [axis for axis, letter in enumerate("xyz") if letter != edge[rows][0]]
        middles[k, level] = hard_iron(outputs[rows][:, level])
    count = np.sum(np.isfinite(middles), axis=0)
    middle = np.where(count > 0, np.nansum(middles, axis=0) / np.maximum(count, 1), np.nan)
    middle_std = np.where(count > 0, std / np.sqrt(2 * np.maximum(count, 1)), np.nan)  # of half a sum of two
    about_z = outputs[turn == turn[np.argmax(edge == "z")]][:, :2]
    round_z = ellipse(about_z - hard_iron(about_z))
    return ByHand(middle, middle_std, round_z, _left_per_mille(outputs, middle, round_z, about_z))


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
