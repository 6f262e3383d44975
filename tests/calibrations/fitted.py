"""Models with values, written by hand: as if they had been fitted."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue
from calibrations.model import Estimate, Model, Term

Numbers = float | tuple[float, ...]
LINEAR: Mapping[str, Mapping[str, Numbers]] = {"bias": {"bias": (2.5, 2.45)}, "scale-factor": {"scale": (1.01, 0.98)}}
PHYSICAL = LINEAR | {
    "cross-axis-bias": {"square": (0.004, -0.006)},
    "z-axis-bias": {"square": (0.01, 0.02)},
    "z-axis-scale": {"slope": (0.004, -0.003), "square": (0.002, 0.005)},
    "axis-misalignment": {"x": 0.75, "y": -0.33, "z": 0.5},
    "axis-nonorthogonality": {"xy": 0.4},
}
REFERENCES = {
    "reference_c": 25.0,
    "reference_v": 5.0,
    "begin_s": 100.0,
    "middle_s": 3600.0,
    "span_s": 7200.0,
    "wanders": 0.0,
    "middle": 2.5,
    "half_span": 1.0,
    "turned_x": 1.0,
    "turned_y": 1.0,
    "turned_z": 1.0,
    "assumed": 1.0,
    "level": 0.0,
}


def model(
    values: Mapping[str, Mapping[str, Numbers]],
    own: Mapping[str, Effect] | None = None,
    std: float | None = 1e-5,
    constants: Mapping[str, float] = MappingProxyType({}),
) -> Model:
    """A model of effects by name, each with its parameters: a number, or one for each axis x, y, z that is there."""
    known = {**catalogue(), **(own or {})}
    terms = []
    for name, parameters in values.items():
        effect = known[name]
        units = {parameter.name: parameter.unit for parameter in effect.parameters}
        estimates = [
            Estimate(p, axis, value, std, units[p].replace("{out}", "V"))
            for p, given in parameters.items()
            for axis, value in (zip("xyz", given, strict=False) if isinstance(given, tuple) else [("", given)])
        ]
        kept = {
            c: {**REFERENCES, "lead_s": 0.0, **effect.assumed_constants, **constants}.get(c, 1.0)
            for c in effect.constants
        }
        terms.append(Term(effect, estimates=tuple(estimates), constants=kept))
    return Model("by-hand", tuple(terms), "V", {"data": "a run", "sensor": "ADXL203", "serial": "17"})
