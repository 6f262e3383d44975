"""temperature-cycle: tumble the sensor at each temperature of an oven, in rising, then falling order.

Excites   temperature effects on bias and scale factor, and their hysteresis.
Blind to  ageing during one cycle, which looks like hysteresis (two cycles separate them); hysteresis that an overshoot
          of the oven removes.
Source    IEEE 1293, temperature sensitivity; Book 17.3.12.
"""

from __future__ import annotations

from procedures.bounds import require_bounded
from procedures.errors import SettingError
from procedures.level_check import prepare
from procedures.session import Session
from procedures.tumbles import is_first, tumble

SLICE_S = 60.0  # interval of the temperature checks in a soak
LARGEST_DRIFT_K = 3.0  # from the set point: the oven was off during an interruption


def temperature_cycle(
    rig: Session,
    *,
    temperatures_c: tuple[float, ...] = (35.0, 50.0, 65.0),
    cycles: int = 1,
    soak_s: float = 3600.0,
    dwell_s: float = 5.0,
    settle_s: float = 0.5,
) -> None:
    """Step through the temperatures in rising, then falling order, with a tumble at each.

    The oven cannot cool: the lowest temperature must be above the temperature of the powered sensor in the room. The
    oven is switched off at the end, and when a run fails.

    temperatures_c  The temperatures of the oven.
    cycles          The number of cycles. Two or more separate hysteresis from drift.
    soak_s          How long the sensor stays at a temperature before its tumble.
    """
    steps = staircase(temperatures_c, cycles)
    if min(soak_s, settle_s) < 0 or dwell_s <= 0:
        raise SettingError("temperature-cycle: soak_s and settle_s must be 0 or more, dwell_s must be above 0")
    prepare(rig)
    set_c = dict(steps)
    for pose in rig.missing(pose for path, _ in steps for pose in tumble(path)):
        _warm(rig, set_c[pose.path], soak_s, is_first(pose))
        rig.hold(pose, dwell_s, settle_s)
    rig.oven.run(False)


def staircase(temperatures_c: tuple[float, ...], cycles: int) -> list[tuple[str, float]]:
    """(path, set point in C) of every step: up, then down, in each cycle. Raises SettingError."""
    rising = sorted(set(temperatures_c))
    if len(rising) < 2:
        raise SettingError("temperature-cycle: give at least two different temperatures_c, such as 35,50,65")
    if cycles < 1:
        raise SettingError(
            f"temperature-cycle: cycles is {cycles}; give 1 or more, 2 to separate hysteresis from drift"
        )
    steps = [*(("up", c) for c in rising), *(("down", c) for c in rising[-2::-1])]
    return require_bounded((f"{branch} {c:g} cycle {k}", c) for k in range(1, cycles + 1) for branch, c in steps)


def _warm(rig: Session, set_c: float, soak_s: float, begins: bool) -> None:
    """Set the oven to `set_c`; soak at the beginning of a step, or if the oven has cooled during an interruption.

    A second soak follows if the first does not end near `set_c`: the controller was without power for a moment, or the
    soak is too short.
    """
    _heat(rig, set_c)
    is_near = _is_near(rig, set_c)
    if begins or not is_near:
        _soak(rig, soak_s)
        if _is_near(rig, set_c) is False:
            _heat(rig, set_c)
            _soak(rig, soak_s)


def _heat(rig: Session, set_c: float) -> None:
    """Set the oven to `set_c`: before every pose, so that a resumed run sends the same commands."""
    rig.oven.set_temperature(set_c)
    rig.oven.run(True)


def _is_near(rig: Session, set_c: float) -> bool | None:
    """Whether the temperature is that of the set point; None if it is unknown."""
    actual_c = rig.oven.temperature_c()
    return None if actual_c is None else abs(actual_c - set_c) <= LARGEST_DRIFT_K


def _soak(rig: Session, soak_s: float) -> None:
    remaining_s = soak_s
    while remaining_s > 0:
        rig.wait(min(SLICE_S, remaining_s))
        rig.check_temperature(rig.oven.temperature_c())
        remaining_s -= SLICE_S
