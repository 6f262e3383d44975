"""What check poses say of a model, in words and as JSON: those that `rig plan sweep --optimal` keeps out of the fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from calibrations.discovery.check_poses import Check


def lines(check: Check | None, data: str) -> Iterator[str]:
    """For people; nothing where there is nothing to check on."""
    if check is None:
        return
    poses = f"{check.poses} check poses, which a fit to the others has not seen,"
    yield f"{poses} are missed by {check.error:.2f} x what is foreseen{_verdict(check, data)}."
    if check.repeats:
        differ = f"{check.repeats} repeats of poses differ by {check.pure_error:.2f} x what white noise makes"
        yield f"{differ}{_visits(check)}."


def document(check: Check | None) -> dict[str, Any]:
    """The key `unseen` of a fit's document."""
    return {} if check is None else {"unseen": {**asdict(check), "passed": check.passed}}


def _verdict(check: Check, data: str) -> str:
    if check.passed:
        return ": no more than noise"
    return f" (chance {check.chance:.0e}): the model misses something, see rig diagnose {data}"


def _visits(check: Check) -> str:
    return "" if check.steady else ": something changes from visit to visit"
