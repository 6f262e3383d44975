"""How early a soak's final bias is known, how often the bounds hold it, and what the filters cost.

Beside it the batch fit of exponentials (`steady_state`) of the reversals so far, with 1.96 standard errors as bounds.
Soaks by laws of their own (tests/calibrations/drifting.py), out of physics (tests/calibrations/warming.py), and of the
simulated world. Each is looked at after 1, 1.5, 2, 3, 4, 6, 8 and 12 hours. A prediction is within its limit where it
says that it is known, and its bounds hold.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np

from calibrations.analyses.forecast import Forecast, QuantityFilter, filter_soak
from calibrations.analyses.soak import fit_steady_state
from calibrations.analyses.tumble import estimate_tumbles
from calibrations.criteria import MOST_KNOWN_WIDTH
from calibrations.errors import TooFewRows
from tests.calibrations.drifting import Drifting, drifting, soak_of_world
from tests.calibrations.warming import warming

LOOKS_H = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0)
SIGMAS = 1.96


@dataclass(frozen=True)
class Look:
    """What is said at one time, and whether it is so: lengths in V."""

    at_h: float
    half: float
    error: float
    holds: bool
    known: bool
    batch_half: float
    batch_error: float
    batch_known: bool

    @property
    def batch_holds(self) -> bool:
        return abs(self.batch_error) <= self.batch_half


def looked(forecast: Forecast, at_h: float, final_v: float, reversals: list[tuple[float, float, float]]) -> Look:
    """At one time: `reversals` are those so far, (s, V, V)."""
    batch = (np.inf, np.inf, False)
    try:
        state = fit_steady_state(*(np.array(column) for column in zip(*reversals, strict=True)))
        half = SIGMAS * state.final[1]
        change = abs(state.final[0] - reversals[0][1])
        batch = (
            half,
            state.final[0] - final_v,
            bool(state.terms) and half <= max(state.tolerance, MOST_KNOWN_WIDTH * change),
        )
    except TooFewRows:
        pass
    holds = forecast.final.low <= final_v <= forecast.final.high
    return Look(at_h, forecast.final.half, forecast.final.value - final_v, holds, forecast.known, *batch)


def of_laws(seed: int) -> Iterator[Look]:
    """A bias by laws of its own."""
    return of_bias(drifting(seed))


def of_physics(seed: int) -> Iterator[Look]:
    """A bias that follows heat through a board into a house."""
    return of_bias(warming(seed))


def of_bias(soak: Drifting) -> Iterator[Look]:
    """Looked at while its values come."""
    looks = list(LOOKS_H)
    first, *rest = soak.values
    told, reversals = (
        QuantityFilter.of(first.t_s, first.volts, first.std_v, 1.0),
        [(first.t_s, first.volts, first.std_v)],
    )
    for value in rest:
        told = told.after(value.t_s, value.volts, value.std_v, offset=value.held)
        if not value.held:
            reversals.append((value.t_s, value.volts, value.std_v))
            if looks and value.t_s >= 3600 * looks[0]:
                yield looked(told.forecast(), looks.pop(0), soak.final_v, reversals)


def of_world(seed: int) -> Iterator[Look]:
    """The bias of x, and of y, of a simulated sensor."""
    table, settled = soak_of_world(seed)
    for axis in "xy":
        (end,), looks = estimate_tumbles(settled, axis), list(LOOKS_H)
        done = estimate_tumbles(table, axis)
        for told in filter_soak(table):
            here = told.followed.get(f"bias-{axis}")
            if here and looks and here.bank.t_s >= 3600 * looks[0]:
                reversals = [(each.t_s, each.bias_v, each.bias_std_v) for each in done if each.t_s <= here.bank.t_s]
                yield looked(here.forecast(), looks.pop(0), end.bias_v, reversals)


def summary(looks: list[Look]) -> dict[str, Any]:
    """Shares and medians at one time; microvolts."""
    known, batch = [look for look in looks if look.known], [look for look in looks if look.batch_known]
    return {
        "at_h": looks[0].at_h,
        "held": share([look.holds for look in looks]),
        "half_uv": 1e6 * median(look.half for look in looks),
        "error_uv": 1e6 * median(abs(look.error) for look in looks),
        "known": len(known) / len(looks),
        "held_when_known": share([look.holds for look in known]),
        "batch_held": share([look.batch_holds for look in looks if np.isfinite(look.batch_half)]),
        "batch_error_uv": 1e6 * median(abs(look.batch_error) for look in looks),
        "batch_known": len(batch) / len(looks),
        "batch_held_when_known": share([look.batch_holds for look in batch]),
    }


def share(holds: list[bool]) -> float | None:
    return float(np.mean(holds)) if holds else None


def cost() -> dict[str, float]:
    """Processor time of one value, in the beginning and on average over a soak, and of one forecast; ms."""
    soak = drifting(1)
    first, *rest = soak.values
    told, spent = QuantityFilter.of(first.t_s, first.volts, first.std_v, 1.0), []
    for value in rest:
        began = time.process_time()
        told = told.after(value.t_s, value.volts, value.std_v, offset=value.held)
        spent.append(1e3 * (time.process_time() - began))
    began = time.process_time()
    for _ in range(20):
        told.forecast()
    return {"first_ms": spent[0], "mean_ms": float(np.mean(spent)), "forecast_ms": 50 * (time.process_time() - began)}


def main(kind: str, first: str, last: str) -> None:
    maker = {"laws": of_laws, "physics": of_physics, "world": of_world}[kind]
    looks = [look for seed in range(int(first), int(last)) for look in maker(seed)]
    at = [summary([look for look in looks if look.at_h == h]) for h in LOOKS_H]
    every = [look for look in looks if look.known]
    print(
        json.dumps({"kind": kind, "held_when_known": share([look.holds for look in every]), "at": at, "cost": cost()})
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
