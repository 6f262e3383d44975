"""Names of results on a certificate, after IEEE Std 1293 and IEEE Std 2700, and their units in SI.

A parameter's name on limits in the bench file is `effect-parameter-axis`, without redundant parts: `bias-x`,
`scale-factor-y`, `axis-misalignment-z`, `z-axis-scale-slope-x`.

Units follow the D-SI: `V/g^2` becomes \\volt\\metre\\tothe{-2}\\second\\tothe{4}. The unit g is the
local gravity. A count, a share and the field's strength are pure numbers.

Source  D-SI metadata model (SmartCom), BIPM SI Brochure (names).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping

from calibrations.effects import Effect, Parameter
from calibrations.errors import DataError

# unit -> factor to SI, and SI names with their powers; g is the place's own
SI: Mapping[str, tuple[float, Mapping[str, int]]] = {
    "V": (1.0, {"volt": 1}),
    "K": (1.0, {"kelvin": 1}),
    "C": (1.0, {"degreecelsius": 1}),
    "s": (1.0, {"second": 1}),
    "h": (3600.0, {"second": 1}),
    "Hz": (1.0, {"hertz": 1}),
    "deg": (1.0, {"degree": 1}),
    "deg/s": (1.0, {"degree": 1, "second": -1}),
    "rad": (1.0, {"radian": 1}),
    "s2": (1.0, {"second": 2}),
    "T": (1.0, {"tesla": 1}),
    "mT": (1e-3, {"tesla": 1}),
    "uT": (1e-6, {"tesla": 1}),
    "nT": (1e-9, {"tesla": 1}),
    "gauss": (1e-4, {"tesla": 1}),
    "mgauss": (1e-7, {"tesla": 1}),
    "m": (1.0, {"metre": 1}),
    "mg": (1e-3, {"metre": 1, "second": -2}),
    "g": (1.0, {"metre": 1, "second": -2}),
    "1": (1.0, {}),
    "count": (1.0, {}),
    "counts": (1.0, {}),
    "field": (1.0, {}),
}
PART = r"\([^)]*\)|[^/]+"  # of a unit; a group in brackets is one part
GRAVITY_UNITS = ("g", "mg")


def in_si(unit: str, gravity_m_s2: float) -> tuple[float, str]:
    """The factor by which a value in `unit` is multiplied, and its D-SI unit. Raises DataError for an unknown one."""
    factor, powers = _si_factor(unit, gravity_m_s2)
    return factor, _unit_text(powers)


def product_in_si(first: str, second: str) -> str:
    """The D-SI unit of the product of values in two units, as `in_si` has them. Raises DataError for an unknown one."""
    powers = Counter(_si_factor(first, 1.0)[1])
    for name, power in _si_factor(second, 1.0)[1].items():
        powers[name] += power
    return _unit_text(powers)


def _unit_text(powers: Mapping[str, int]) -> str:
    return "".join(f"\\{n}" + (f"\\tothe{{{p}}}" if p != 1 else "") for n, p in powers.items() if p) or "\\one"


def _si_factor(unit: str, gravity_m_s2: float) -> tuple[float, dict[str, int]]:
    """The factor, and the powers of the SI units."""
    factor, powers = 1.0, dict[str, int]()
    for place, part in enumerate(re.findall(PART, unit or "1")):
        word, _, exponent = part.strip("()").partition("^")
        if word not in SI:
            units = "V, m/s^2, deg/s, uT, K, s or counts"
            raise DataError(f'the unit "{unit}" has no SI form here; convert the data to {units}')
        sign = (int(exponent) if exponent else 1) * (-1 if place else 1)
        scale, names = SI[word]
        factor *= (scale * (gravity_m_s2 if word in GRAVITY_UNITS else 1.0)) ** sign
        for name, power in names.items():
            powers[name] = powers.get(name, 0) + sign * power
    return factor, powers


TERMS: Mapping[str, str] = {
    "bias": "bias K0 (zero-g offset)",
    "scale-factor": "scale factor K1 (sensitivity)",
    "scale-factor-asymmetry": "scale factor asymmetry K1'/2",
    "quadratic-nonlinearity": "second-order coefficient K2 K1",
    "cubic-nonlinearity": "third-order coefficient K3 K1",
    "odd-quadratic-nonlinearity": "odd quadratic coefficient K_oq K1",
    "cross-axis-bias": "cross-axis nonlinearity K_pp K1",
    "z-axis-bias": "cross-axis nonlinearity K_oo K1",
    "cross-axis-scale": "cross-coupling coefficient K_ip K1",
    "z-axis-scale": "cross-coupling coefficient K_io K1",
    "axis-misalignment": "input axis misalignment",
    "axis-nonorthogonality": "input axis non-orthogonality (cross-axis sensitivity)",
    "temperature-bias": "bias temperature sensitivity (zero-g offset temperature coefficient)",
    "temperature-scale": "scale factor temperature sensitivity",
    "supply-sensitivity": "supply voltage sensitivity",
    "hysteresis": "hysteresis error",
    "dead-zone": "dead band",
    "gyro-bias": "bias (zero-rate output)",
    "gyro-scale-factor": "scale factor (sensitivity)",
    "gyro-misalignment": "input axis misalignment",
    "gyro-g-sensitivity": "acceleration-sensitive drift",
    "field-strength": "indicated strength of the local field",
    "hard-iron": "offset (zero-field output, with hard iron)",
    "soft-iron": "relative distortion of the field (soft iron)",
}


def term(effect: Effect, parameter: Parameter) -> str:
    """The term of the standards, otherwise the name of the effect, with the parameter if there are several."""
    name = TERMS.get(effect.name, effect.name.replace("-", " "))
    return name if len(effect.parameters) == 1 else f"{name}, {parameter.name.replace('_', ' ')}"


def name(effect: Effect, parameter: str, axis: str) -> str:
    """The name that limits are given by."""
    suffix = [] if len(effect.parameters) == 1 else [parameter.replace("_", "-")]
    return "-".join([effect.name, *suffix, *([axis] if axis else [])])


def names(effect: Effect) -> list[str]:
    """Every name that an effect's parameters can have."""
    return [name(effect, p.name, axis) for p in effect.parameters for axis in ("x", "y", "z", "")]
