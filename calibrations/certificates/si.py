"""A result's unit as the D-SI has it, in SI units: `V/g^2` becomes \\volt\\metre\\tothe{-2}\\second\\tothe{4}.

The local gravity is what g stands for. A count, a share and the field's strength are pure numbers.
Source  D-SI metadata model (SmartCom), BIPM SI Brochure names.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

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
    "m": (1.0, {"metre": 1}),
    "mg": (1e-3, {"metre": 1, "second": -2}),
    "g": (1.0, {"metre": 1, "second": -2}),
    "1": (1.0, {}),
    "count": (1.0, {}),
    "counts": (1.0, {}),
    "field": (1.0, {}),
}
PART = r"\([^)]*\)|[^/]+"  # of a unit; what is in brackets is one
OF_GRAVITY = ("g", "mg")


def in_si(unit: str, gravity_m_s2: float) -> tuple[float, str]:
    """The factor by which a value in `unit` is multiplied, and its D-SI unit. Raises DataError for an unknown one."""
    factor, powers = 1.0, dict[str, int]()
    for place, part in enumerate(re.findall(PART, unit or "1")):
        word, _, exponent = part.strip("()").partition("^")
        if word not in SI:
            raise DataError(f'the unit "{unit}" has no SI form here; convert the data to V, m/s^2, K, s or counts')
        sign = (int(exponent) if exponent else 1) * (-1 if place else 1)
        scale, names = SI[word]
        factor *= (scale * (gravity_m_s2 if word in OF_GRAVITY else 1.0)) ** sign
        for name, power in names.items():
            powers[name] = powers.get(name, 0) + sign * power
    return factor, "".join(f"\\{n}" + (f"\\tothe{{{p}}}" if p != 1 else "") for n, p in powers.items() if p) or "\\one"
