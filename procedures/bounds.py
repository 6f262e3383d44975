"""How many poses a procedure may have: a mistyped setting is refused before a plan of it fills the memory."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from typing import TypeVar

from procedures.errors import SettingError

Item = TypeVar("Item")
MOST_POSES = 50_000  # of a plan: about a week on a rig; more is a mistyped setting
MOST_COUNTED = 4 * MOST_POSES  # one by one, which takes a moment
LARGEST_NUMBER = 1e15  # in a message
FEWER = "a larger step, a shorter duration, or fewer angles and repetitions"


def require_bounded(poses: Iterable[Item]) -> list[Item]:
    """All `poses`, or their paths. Raises SettingError above MOST_POSES; the others are counted, not stored."""
    remaining = iter(poses)
    listed = list(islice(remaining, MOST_POSES))
    require_possible(len(listed) + sum(1 for _ in islice(remaining, MOST_COUNTED - MOST_POSES)), FEWER, MOST_COUNTED)
    return listed


def require_possible(poses: float, change: str, counted: float = LARGEST_NUMBER) -> None:
    """Raises SettingError for more than MOST_POSES; `change` names what to give instead.

    `counted`: the number from which the poses are not counted any more.
    """
    if poses <= MOST_POSES:
        return
    number = f"{poses:.0f}" if poses < counted else f"at least {counted:.0f}"
    raise SettingError(f"the plan has {number} poses; the limit is {MOST_POSES}; give {change}")


def count_parts(total: float, part: float) -> int:
    """How often `part` fits in `total`, at least once. Raises SettingError for more than MOST_POSES."""
    count = total / part
    require_possible(count, FEWER)
    return max(1, round(count))
