"""What every written compensation says of itself: where it comes from, units, range, bound, costs, uncertainties."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, Context
from textwrap import wrap

from calibrations.compensation.cost import Size
from calibrations.compensation.forward import FORCES, INVERTED, LEFT_OUT, NOISE, OF_THE_RIG
from calibrations.compensation.inverse import Compensation
from calibrations.model import Estimate
from calibrations.numerals import as_written

WIDTH = 112
UPWARD = Context(prec=3, rounding=ROUND_CEILING)  # bounds are not rounded down
IN = {
    "g": "g, the local gravity of the calibration",
    "field": "shares of the field at the calibration",
    "deg/s": "deg/s",
}
SAID = {"data": "data", "data_sha256": "SHA-256 of the data", "created": "calibrated", "sensor": "sensor",
        "serial": "serial number", "gravity_m_s2": "local gravity, m/s^2"}  # fmt: skip
UNITS = {"temperature_c": "C", "supply_v": "V", "t_s": "s since the power came on"}


@dataclass(frozen=True)
class Origin:
    """The model file by name and digest, the program that wrote the source, and when."""

    name: str
    model_file: str
    sha256: str
    program: str
    date: str


def lines(made: Compensation, origin: Origin) -> list[str]:
    """The head of a source file, wrapped; an empty line parts its sections."""
    sections = [_what(made, origin), _inputs(made), _how(made), _effects(made), _uncertainty(made), _parameters(made)]
    return [line for section in sections for line in [*(w for text in section for w in _wrapped(text)), ""]][:-1]


def shown(value: float, unit: str) -> str:
    """An error in the unit of what is sensed, or its thousandth for g."""
    return f"{1e3 * value:.2g} mg" if unit == "g" else f"{value:.2g} {unit}"


def steps(made: Compensation) -> str:
    """`7 steps`."""
    return f"{made.bound.steps} step{'s' if made.bound.steps > 1 else ''}"


def upward(bound: float) -> str:
    """A bound to three digits, never less than it is."""
    return f"{float(UPWARD.create_decimal(bound)):.3g}"


def unit_of_input(name: str, made: Compensation) -> str:
    """The unit of one of the program's inputs."""
    if name[0] == "v" and name[1:] in made.forward.axes:
        return made.model.unit or "V"
    if name in ("ax", "ay", "az"):
        return made.unit
    return UNITS.get(name, "as in the calibration")


def operations(made: Compensation) -> str:
    """`113 add, 102 multiply: 215 a sample`."""
    count: Mapping[str, int] = made.program.operations
    return f"{', '.join(f'{n} {kind}' for kind, n in count.items())}: {sum(count.values())} a sample"


def _wrapped(text: str) -> list[str]:
    indent = " " * (len(text) - len(text.lstrip()))
    return wrap(
        text.strip(), WIDTH, initial_indent=indent, subsequent_indent=indent + "  ", break_on_hyphens=False
    ) or [""]


def _what(made: Compensation, origin: Origin) -> Iterator[str]:
    model = made.model
    yield f"{origin.name}: from outputs to {_sensed(made)} along the reference axes, by the model {model.name}."
    yield f"  in {IN[made.unit]}"
    yield f"  model file  {origin.model_file}, SHA-256 {origin.sha256}"
    for key, title in SAID.items():
        if key in model.provenance:
            yield f"  {title}  {as_written(model.provenance[key])}"
    yield f"  written by {origin.program} on {origin.date}"


def _sensed(made: Compensation) -> str:
    return {
        "g": "specific force",
        "field": "the magnetic field",
        "deg/s": "angular rate",
    }[made.unit]


def _inputs(made: Compensation) -> Iterator[str]:
    yield "Inputs:"
    for axis in made.forward.axes:
        yield f"  v{axis}  output of the {axis} axis, {unit_of_input(f'v{axis}', made)}"
    for name, (low, high) in made.beside.items():
        yield f"  {name}  {unit_of_input(name, made)}, from {low:g} to {high:g}{_of_axis(name, made)}"
    yield f"Proved for +-{made.range.reach:g} {made.unit} on each axis; beyond these ranges nothing is."


def _of_axis(name: str, made: Compensation) -> str:
    if name not in ("ax", "ay", "az"):
        return ""
    if (size := made.costs.out_of_gravity) is None:
        return "; this axis is not measured: give it by another sensor"
    return (
        "; this axis is not measured. Give it by another sensor; or, where nothing but gravity acts, take the function "
        f"for that, which finds it from the others and the side that is up. That costs {_size(size, made.unit)}"
    )


def _how(made: Compensation) -> Iterator[str]:
    bound = made.bound
    left = f"q^{bound.steps} x {made.range.reach:g} {made.unit} = {upward(bound.within)} {made.unit}"
    yield (
        f"Method: a <- a + C (v - G(a)), {steps(made)} from a = 0. Each step comes nearer by the factor "
        f"q <= {upward(bound.q)}, proved over the whole range by interval arithmetic; what is left after the last is "
        f"below {left}, rounding aside."
    )
    yield f"Operations: {operations(made)}."


def _effects(made: Compensation) -> Iterator[str]:
    by_how: dict[str, list[str]] = {}
    for fate in made.forward.fates:
        by_how.setdefault(fate.how, []).append(fate.effect)
    yield f"Inverted: {', '.join(by_how.get(INVERTED, ['nothing']))}."
    if remembering := made.forward.remembering:
        yield (
            f"With a history: {', '.join(remembering)}. Give every sample, in order: {len(made.forward.memory)} "
            "numbers are remembered from one to the next, 0 before the first. Until the way has turned round at both "
            "ends of what the sensor comes through, the true history is not known."
        )
    if rigs := by_how.get(OF_THE_RIG):
        yield f"Of the rig, not of the sensor, and dropped: {', '.join(rigs)}."
    if noise := by_how.get(NOISE):
        yield f"Noise, which no inverse takes off: {', '.join(noise)}."
    for fate in made.forward.fates:
        if fate.how == LEFT_OUT:
            size = made.costs.left_out[fate.effect]
            cost = "what this costs is not computed: a sweep does not show it"
            yield f"Left out: {fate.effect}, because {fate.why}; {f'costs {_size(size, made.unit)}' if size else cost}."


def _size(size: Size, unit: str) -> str:
    return (
        f"{shown(size.rms, unit)} rms and {shown(size.most, unit)} at most in a simulated sweep over the stated ranges"
    )


def covered(made: Compensation) -> str:
    """What the data of the calibration covered beside the directions, and which stated ranges go further."""
    known = made.model.covered
    if not known:
        return (
            "The model file does not say at what temperature, supply or time it was calibrated. Wherever that was not, "
            "the model is extrapolated."
        )
    said = ", ".join(f"{name} {_span(name, known[name], made)}" for name in known)
    beyond = [
        name for name, (low, high) in made.beside.items()
        if name not in FORCES and (name not in known or low < known[name][0] or high > known[name][1])
    ]  # fmt: skip
    text = f"Covered by the data of the calibration: {said}; beyond, the model is extrapolated"
    return f"{text}. The stated range goes beyond in {', '.join(beyond)}." if beyond else f"{text}."


def uncertainty(made: Compensation) -> str:
    """The standard uncertainty by those of the parameters: where they were found, and the greatest of all."""
    found = made.costs.parameters
    if found is None:
        return "Uncertainty: the model file has none."
    where = ", ".join(f"{name} {_span(name, span, made)}" for name, span in found.within.items())
    at = ", ".join(f"{name} {value:.6g}" for name, value in found.at.items())
    return (
        "Standard uncertainty of the result by those of the parameters, taken as independent (a model file has no "
        f"correlations): {shown(found.rms, made.unit)} rms, {shown(found.most, made.unit)} at most over the sphere of "
        f"directions{f' with {where}' if where else ''}; {shown(found.largest, made.unit)} at most over the whole "
        f"stated range{f', at {at}' if at else ''}. Noise and what the model misses are not in it."
    )


def _span(name: str, span: tuple[float, float], made: Compensation) -> str:
    low, high = (f"{end:.6g}" for end in span)
    return f"{low if low == high else f'{low} to {high}'} {unit_of_input(name, made)}"


def _uncertainty(made: Compensation) -> Iterator[str]:
    yield uncertainty(made)
    yield covered(made)


def _parameters(made: Compensation) -> Iterator[str]:
    yield "Parameters, with standard uncertainties:"
    for term in made.model.terms:
        for e in term.estimates:
            yield f"  {term.name} {f'{e.name} {e.axis}'.strip()} = {_value(e)} {e.unit}".rstrip()


def _value(e: Estimate) -> str:
    if not e.identified:
        return f"{e.value:.8g}, not identified,"
    return f"{e.value:.8g} +- {e.std:.2g}" if e.std else f"{e.value:.8g}"
