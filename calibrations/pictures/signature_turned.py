"""The signature of an effect of magnetometers or gyroscopes: turns about each edge of the sensor."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from calibrations.chain import Step, respond, sensed
from calibrations.effect import Effect, catalogue
from calibrations.pictures.shown import Curve, Panel, shown
from calibrations.pictures.style import BLUE, GREEN, VERMILION
from calibrations.table import AXES, Array, Table
from calibrations.turning import rate_deg_s

COLOURS = (VERMILION, GREEN, BLUE)
TURN_DEG = np.arange(0.0, 361.0, 5.0)
RATES_DEG_S = np.linspace(-100.0, 100.0, 21)


def of_field(effect: Effect) -> Panel:
    """What a magnetometer without error leaves of the field's magnitude, in parts per thousand, over full turns."""
    known = catalogue()["field-strength"]
    table = _turned_in_a_field()
    steps: list[Step] = [] if effect.name == known.name else [(known, {"total": np.asarray(1.0)})]
    steps.append((effect, shown(effect, table)))
    output = respond(sensed(table.outputs, table, steps), table, steps)
    left = np.asarray(np.round(1e3 * (np.linalg.norm(output, axis=1) - 1.0), 4) + 0.0)
    curves = tuple(_curves(len(TURN_DEG)))
    return Panel("|m|", left, np.tile(TURN_DEG, 3), "angle of the turn (deg)", curves, "‰ of the field")


def of_rates(effect: Effect) -> list[Panel]:
    """What a gyroscope without error leaves of each output, in deg/s, over the rate of turns about each edge."""
    known = catalogue()["gyro-scale-factor"]
    table = _turned_at_rates()
    rate = rate_deg_s(table)
    steps: list[Step] = [] if effect.name == known.name else [(known, {**shown(known, table), "scale": np.ones(3)})]
    steps.append((effect, shown(effect, table)))
    left = respond(sensed(rate, table, steps), table, steps) - rate
    curves = tuple(_curves(len(RATES_DEG_S)))
    over = table.column("rate_deg_s")
    return [
        Panel(axis, np.asarray(np.round(left[:, k], 4) + 0.0), over, "rate (deg/s)", curves, "deg/s")
        for k, axis in enumerate(AXES)
    ]


def _curves(n: int) -> Iterator[Curve]:
    """One for each edge that is turned about."""
    for k, (axis, colour) in enumerate(zip(AXES, COLOURS, strict=True)):
        yield Curve(f"about {axis}", colour, "-", np.arange(k * n, (k + 1) * n))


def _turned_in_a_field() -> Table:
    """Full turns about x, y and z across a field of 1."""
    c, s, none = np.cos(np.radians(TURN_DEG)), np.sin(np.radians(TURN_DEG)), np.zeros(len(TURN_DEG))
    turns = [np.column_stack(each) for each in ((none, c, s), (s, none, c), (c, s, none))]
    m: Array = np.vstack(turns)
    return Table.from_columns("positions", dict(zip(("mx", "my", "mz"), m.T, strict=True)), source="turns")


def _turned_at_rates() -> Table:
    """Turns about x, y and z, each upright in its turn."""
    up = np.repeat(np.eye(3), len(RATES_DEG_S), axis=0)
    rate = np.tile(RATES_DEG_S, 3)
    columns = dict(zip(("ax", "ay", "az"), up.T, strict=True)) | {"rate_deg_s": rate}
    columns |= dict(zip(("gx", "gy", "gz"), (up * rate[:, None]).T, strict=True))
    return Table.from_columns("rates", columns, {"unit": "deg/s"}, "turns")
