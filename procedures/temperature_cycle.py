"""temperature-cycle: a tumble at each temperature, the oven stepping up, then down.

Excites   temperature effects on bias and scale factor, and their hysteresis.
Blind to  ageing while one cycle lasts, which looks like hysteresis (two cycles tell them); the part of the loop that
          an overshooting oven closes.
Source    IEEE 1293, temperature sensitivity; Book 17.3.12.
"""

from __future__ import annotations

from procedures.errors import SettingError
from procedures.level_check import levelled
from procedures.session import Session
from procedures.tumbles import is_first, tumble

SLICE_S = 60.0  # of a soak: how often the limits of temperature are looked at meanwhile
DRIFTED_K = 3.0  # from the set point: an oven that stood still in an interruption


def temperature_cycle(
    rig: Session,
    *,
    temperatures_c: tuple[float, ...] = (35.0, 50.0, 65.0),
    cycles: int = 1,
    soak_s: float = 3600.0,
    dwell_s: float = 5.0,
    settle_s: float = 0.5,
) -> None:
    """Go through `temperatures_c` upwards and back, wait `soak_s` at each, then tumble the sensor.

    The oven only heats: the lowest temperature must be above that of the powered sensor in the room. The oven is
    switched off at the end, as it is when a run fails.
    """
    steps = staircase(temperatures_c, cycles)
    if min(soak_s, settle_s) < 0 or dwell_s <= 0:
        raise SettingError("temperature-cycle: soak_s and settle_s must not be below 0, dwell_s must be above")
    rig.confirm("mounting", "Is the sensor mounted face up on the table, its cable free to turn?", drawing="face-up")
    levelled(rig)
    set_c = dict(steps)
    for pose in rig.missing(pose for path, _ in steps for pose in tumble(path)):
        _warm(rig, set_c[pose.path], soak_s, is_first(pose))
        rig.hold(pose, dwell_s, settle_s)
    rig.oven.run(False)


def staircase(temperatures_c: tuple[float, ...], cycles: int) -> list[tuple[str, float]]:
    """(path, set point) of every step: up, then down, of each cycle. Raises SettingError."""
    rising = sorted(set(temperatures_c))
    if len(rising) < 2:
        given = f"{rising[0]:g} alone shows no slope" if rising else "there is none"
        raise SettingError(f"temperature-cycle: temperatures_c must be at least two, such as 35,50,65; {given}")
    if cycles < 1:
        raise SettingError(f"temperature-cycle: cycles must be 1 or more, is {cycles}; two tell hysteresis from drift")
    once = [*(("up", c) for c in rising), *(("down", c) for c in rising[-2::-1])]
    return [(f"{way} {c:g} cycle {k}", c) for k in range(1, cycles + 1) for way, c in once]


def _warm(rig: Session, set_c: float, soak_s: float, begins: bool) -> None:
    """Have the oven at `set_c`; soak where a step begins, or where the oven has cooled in an interruption.

    It is told before every pose, so that a run that goes on does as one that was not disturbed.
    """
    rig.oven.set_temperature(set_c)
    rig.oven.run(True)
    shown_c = rig.oven.temperature_c()
    if begins or shown_c is None or abs(shown_c - set_c) > DRIFTED_K:
        _soak(rig, soak_s)


def _soak(rig: Session, soak_s: float) -> None:
    left_s = soak_s
    while left_s > 0:
        rig.wait(min(SLICE_S, left_s))
        rig.check_temperature(rig.oven.temperature_c())
        left_s -= SLICE_S
