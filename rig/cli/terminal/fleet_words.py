"""What fleets come to, in words for a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from calibrations.fleet.batch import BatchEffect, Population, SensorVerdict
from calibrations.presentation.text import columns, concise, joined, percent
from rig.fleet.calibrate import Calibrated, Calibration

MOST_SENSORS = 20
VERDICTS = ("adequate", "effect-missing", "ambiguous", "unexplained", "no-response", "failed")


def population(found: Population, model: str) -> Iterator[str]:
    """Of `rig fleet discover`."""
    counts = ", ".join(f"{found.verdicts[v]} {v}" for v in VERDICTS if found.verdicts[v])
    yield f"{model} on {len(found.sensors)} sensors: {counts}"
    rows = [
        (each.batch or "-", each.sensors, _shared(each.effects), _shares(each.shares, {e.effect for e in each.effects}))
        for each in found.batches
    ]
    yield ""
    yield columns(("batch", "sensors", "all its sensors miss", "some of them"), rows)
    yield from _rigs(found)
    yield from _persons([each for each in found.sensors if each.needs_a_person])


def _shared(effects: Iterable[BatchEffect]) -> str:
    return ", ".join(_with_rivals(each.effect, each.rivals) for each in effects) or "nothing"


def _with_rivals(name: str, rivals: Iterable[str]) -> str:
    others = list(rivals)
    return f"{name} (or {joined(others)})" if others else name


def _shares(shares: Mapping[str, float], shared: set[str]) -> str:
    return ", ".join(f"{name} {percent(share)}" for name, share in shares.items() if name not in shared) or "-"


def _rigs(found: Population) -> Iterator[str]:
    beyond = [error for error in found.rigs if error.beyond]
    if beyond:
        yield ""
        yield "Errors of rigs, against the median of the rigs; poses were corrected by them:"
        rows = [
            (
                e.rig,
                e.effect,
                concise(e.value, e.std, e.unit),
                e.parameter,
                e.sensors,
            )
            for e in beyond
        ]
        yield columns(("rig", "effect", "value", "parameter", "sensors"), rows)
    rigs = {rig for group in found.unconnected for rig in group}
    if len(rigs) == 1:
        yield ""
        yield "All were measured on one rig: an error of its stages cannot be told from one that all sensors have."
    elif len(found.unconnected) > 1:
        yield ""
        groups = "; ".join(joined(group) for group in found.unconnected)
        yield f"No batch was measured on two of these groups of rigs, which cannot be compared: {groups}."


def _persons(sensors: list[SensorVerdict]) -> Iterator[str]:
    if not sensors:
        return
    yield ""
    order = sorted(sensors, key=lambda each: (VERDICTS.index(each.verdict), len(each.own)), reverse=True)
    yield f"{len(order)} sensors need a person{f', {MOST_SENSORS} of them' if len(order) > MOST_SENSORS else ''}:"
    rows = [(each.sensor, each.batch or "-", each.rig or "-", each.verdict, why(each)) for each in order[:MOST_SENSORS]]
    yield columns(("sensor", "batch", "rig", "verdict", "why"), rows)


def why(each: SensorVerdict) -> str:
    """What is the matter with a sensor."""
    named = [_with_rivals(name, each.rivals.get(name, ())) for name in (each.own or each.effects)]
    return "; ".join(filter(None, (", ".join(named), each.remark))) or "-"


def calibration(found: Calibration) -> Iterator[str]:
    """Of `rig fleet calibrate`."""
    for batch in found.batches:
        yield from (*_batch(batch), "")
    for member, fault in found.faults.items():
        yield f"{member.sensor} is not calibrated: {fault}"


def _batch(batch: Calibrated) -> Iterator[str]:
    out = [m.sensor for m, unlike in zip(batch.members, batch.unlike, strict=True) if unlike]
    yield f"batch {batch.batch or '-'}: {len(batch.members)} sensors"
    rows = []
    for (effect, name, axis, unit), each, size, gain in zip(
        batch.names, batch.pooled.parameters, batch.pooled.scale, _gains(batch), strict=True
    ):
        mean = concise(each.mean * size, each.mean_std * size, unit)
        apart = [m.sensor for m, alone in zip(batch.members, each.apart, strict=True) if alone]
        rows.append((effect, name, axis or "-", mean, f"{each.spread * size:.2g} {unit}", f"{gain:.2f}", _named(apart)))
    yield columns(("effect", "parameter", "axis", "mean", "spread", "std / alone", "unlike the others"), rows)
    if out:
        yield f"Not described by this model: {_named(out)}; `rig fleet discover` says what they miss."


def _gains(batch: Calibrated) -> list[float]:
    import numpy as np

    return list(map(float, np.median(batch.pooled.stds / batch.pooled.alone, axis=0)))


def _named(sensors: list[str]) -> str:
    shown = ", ".join(sensors[:5])
    return f"{shown} and {len(sensors) - 5} more" if len(sensors) > 5 else shown or "-"
