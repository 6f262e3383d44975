"""What a parameter is called on a certificate: IEEE Std 1293 with its symbol, and IEEE Std 2700 where it has a name.

A parameter's name on limits in the bench file is `effect-parameter-axis`, without what says nothing: `bias-x`,
`scale-factor-y`, `axis-misalignment-z`, `z-axis-scale-slope-x`.
"""

from __future__ import annotations

from collections.abc import Mapping

from calibrations.effect import Effect, Parameter

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
}


def term(effect: Effect, parameter: Parameter) -> str:
    """The standards' term, else the effect's own name; with the parameter where there are several."""
    name = TERMS.get(effect.name, effect.name.replace("-", " "))
    return name if len(effect.parameters) == 1 else f"{name}, {parameter.name.replace('_', ' ')}"


def name(effect: Effect, parameter: str, axis: str) -> str:
    """The name that limits are given by."""
    own = [] if len(effect.parameters) == 1 else [parameter.replace("_", "-")]
    return "-".join([effect.name, *own, *([axis] if axis else [])])


def names(effect: Effect) -> list[str]:
    """Every name that an effect's parameters can have."""
    return [name(effect, p.name, axis) for p in effect.parameters for axis in ("x", "y", "z", "")]
