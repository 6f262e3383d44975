"""The components that can act at each place of the signal chain: free forms and forms of catalogue effects.

Every component is normalised to unit rms at the start of a search, so that a variance is the mean square of what it
adds to the output. Constant and linear parts over the forces are in the base (`chain`).
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from calibrations.effects.signal.saturation import beyond
from calibrations.free_forms.bases import Clips, Harmonics, Play, Preisach, Products, Ramp, spline
from calibrations.free_forms.chain import State
from calibrations.free_forms.components import (
    GENERAL,
    PRODUCT,
    Basis,
    Columns,
    Component,
    Make,
    Starts,
    free,
    per_axis,
)
from calibrations.free_forms.form import CROSS, TILT, TURNED, Factor, Form
from calibrations.free_forms.place_names import acts_at_rest
from calibrations.free_forms.places_in_time import FEWEST_TIMED, over_temperature, over_time, slow_noise
from calibrations.free_forms.places_of_columns import over_columns, over_output
from calibrations.free_forms.poses import LOGGED_DEG, SIDES, PoseData
from calibrations.geometry.orientation import out_of_plane
from calibrations.geometry.stage_path import STATED_APPROACH
from calibrations.table import Array

WIDTHS_G = tuple(np.geomspace(0.01, 1.8, 14).tolist())  # of slip elements
LOOPS_G = (0.02, 0.06, 0.15, 0.35, 0.8)  # half widths of the loops of a Preisach hysteresis
LOOP_INTERVALS = 8
DEAD_G = (0.003, 0.012, 0.05)
THRESHOLDS_G = tuple(np.geomspace(0.002, 0.2, 8).tolist())  # of dead zones that are not all of one width
OFF_CENTRE_G = 0.02  # a sensor's own zero, about which its dead zone may lie
KNEE_G = 0.005  # width of a hard bend where the search for it starts
# Where saturation begins, as a part of the range, and the width of its bend, g: a soft one shows at the end alone.
BENDS = ((0.75, KNEE_G), (0.9, KNEE_G), (0.97, KNEE_G), (0.99, KNEE_G), (0.97, 0.03), (0.99, 0.03))
DEGREE = 4  # of a general function of the force's direction
FEWEST_ANGLES, FINE_ANGLES = 8, 33  # different angles beta that can show harmonics, and fine ones
FEWEST_HEADINGS = 6  # the same for a few harmonics
FEWEST_INCLINATIONS = 4


def components(data: PoseData, first: State, flicker: bool = False) -> list[Component]:
    """Every component that this table can show, but those at places that the search leaves out.

    At one orientation nothing over the force can be known, nor a scale factor over anything else. `flicker`: slow noise
    of all frequencies.
    """
    candidates = [
        *slow_noise(data, flicker),
        *_stages(data, first),
        *_response_components(data, first),
        *_cross_axis_components(data, first),
        *_history(data, first),
        *_over_beta(data, first),
        *over_temperature(data, first),
        *over_time(data, first),
        *over_output(data, first),
        *over_columns(data, first),
        *_general(first),
    ]
    if data.at_rest:
        candidates = [c for c in candidates if c.noise or (acts_at_rest(c.place) and not c.scales)]
    return [c for c in candidates if c.place not in data.table.left_out]


def _stages(data: PoseData, first: State) -> list[Component]:
    components: list[Component] = []
    place = "stage-angle-beta"
    angles = len(np.unique(np.round(np.mod(data.beta, 2 * np.pi), 3)))
    if angles >= FEWEST_HEADINGS:
        eccentricity = Harmonics(1, 1)(data.beta)
        components.append(
            Component(f"{place}/stage-eccentricity", place, "beta", "stage-eccentricity", angle=eccentricity)
        )
        waves = Harmonics(2, 9 if angles > FEWEST_ANGLES else (angles - 1) // 2)  # a shorter one would look like these
        components.append(free(Form(place, "curve", "beta", (waves,), shared=True), first))
        if angles > FINE_ANGLES:
            fine = Form(place, "fine", "beta", (Harmonics(4, 16, power=0.0),), shared=True)
            components.append(free(fine, first, price=PRODUCT))
    for approach, turn in data.sides.items():
        if np.ptp(turn) > 0:
            components.append(
                Component(
                    f"{place}/stage-backlash@{SIDES[approach]}", place, "beta", "stage-backlash",
                    angle=turn[:, None], constants=(("approach_deg", approach),),
                )
            )  # fmt: skip
            form = Form(
                place, f"side-{SIDES[approach]}", "beta", (Harmonics(1, 4),), "side", shared=True, approach_deg=approach
            )
            components.append(free(form, first, price=PRODUCT))
    if len(np.unique(np.round(data.alpha, 4))) >= FEWEST_INCLINATIONS:
        form = Form("stage-angle-alpha", "curve", "alpha", (spline(data.alpha, 10, order=1),), shared=True)
        components.append(free(form, first, price=PRODUCT))
    if data.timed and data.n >= FEWEST_TIMED:
        over_time = (spline(data.table.time_s, 10, order=1),)  # a base that sinks turns in a straight line
        components += [
            free(Form(TILT, name, "time", over_time, shared=True), first, price=GENERAL, general=True)
            for name in TURNED
        ]
    return components


def _splines_over(forces: Array, count: int, intervals: int) -> tuple[Any, ...]:
    """A spline over each axis's own range of forces (n, 3)."""
    return tuple(spline(forces[:, k], intervals) for k in range(count))


def _response_components(data: PoseData, first: State) -> list[Component]:
    place = "own-response"

    def form(cause: str, basis: Basis) -> Component:
        return Component(f"{place}/{cause}", place, "response", cause, columns=per_axis(basis))

    components = [
        form("quadratic-nonlinearity", lambda s, k: s.force[:, k, None] ** 2),
        form("cubic-nonlinearity", lambda s, k: s.force[:, k, None] ** 3),
        form("odd-quadratic-nonlinearity", lambda s, k: (s.force[:, k] * np.abs(s.force[:, k]))[:, None]),
        form("scale-factor-asymmetry", lambda s, k: np.abs(s.force[:, k, None])),
        free(Form(place, "curve", "own", _splines_over(first.force, data.channels, 22)), first),
    ]
    components += _dead_zones(data)
    components.append(free(Form(place, "thresholds", "own", (Clips(THRESHOLDS_G),)), first, "dead-zone", PRODUCT))
    return components + _saturations(data, first)


def _dead_zones(data: PoseData) -> list[Component]:
    """Dead zones of several widths about several zeros of the channels. Shape: widths, then centres, g."""
    place, c = "own-response", data.channels
    shapes = [
        (*(width,) * c, *centres)
        for width in DEAD_G
        for centres in product((-OFF_CENTRE_G, 0.0, OFF_CENTRE_G) if width < OFF_CENTRE_G else (0.0,), repeat=c)
    ]
    price = 2 * np.log(len(shapes))

    def make_dead_zone(name: str) -> Make:
        def starts(shape: tuple[float, ...]) -> Starts:
            widths, centres = shape[:c], shape[c:]
            return tuple(
                (parameter, axis, value)
                for axis, width, centre in zip(data.axes, widths, centres, strict=True)
                for parameter, value in (("width", abs(width)), ("centre", centre))
            )

        return lambda shape: Component(
            name, place, "response", "dead-zone", f"{place}/dead-zone", price, per_axis(_clipped(shape[:c], shape[c:])),
            shape=shape, step=tuple(0.3 * abs(w) for w in shape[:c]) * 2, reshaped=make_dead_zone(name),
            starts=lambda _: starts(shape),
        )  # fmt: skip

    return [make_dead_zone(f"{place}/dead-zone@{','.join(f'{g:g}' for g in shape)}")(shape) for shape in shapes]


def is_off_centre(component: Component) -> bool:
    """Whether a component is a dead zone away from 0 g, which may be the step of a converter at another voltage."""
    shape = component.shape
    return component.cause == "dead-zone" and any(shape[len(shape) // 2 :])


def _clipped(widths: tuple[float, ...], centres: tuple[float, ...]) -> Basis:
    """Specific force about a centre, clipped at a width, of each channel's own, g."""
    return lambda s, k: np.clip(s.force[:, k, None] - centres[k], -abs(widths[k]), abs(widths[k]))


def _saturations(data: PoseData, first: State) -> list[Component]:
    place = "own-response"
    ranges = [(float(f.min() + f.max()) / 2, float(np.ptp(f)) / 2) for f in first.force.T]
    price = 2 * np.log(3 * len(BENDS))

    def make_saturation(name: str, side: int) -> Make:
        return lambda shape: Component(
            name, place, "response", "saturation", f"{place}/saturation", price, _saturation_columns(shape, side),
            shape=shape, step=(*(0.02,) * (len(shape) - 1), KNEE_G), reshaped=make_saturation(name, side),
            starts=lambda loss: (*_levels(first, shape, side), ("loss", "", float(np.clip(-loss[0], 0.01, 1.0)))),
        )  # fmt: skip

    components = []
    for side, name in ((1, "high"), (-1, "low"), (0, "both")):
        for end, knee in BENDS:
            levels = [(m + end * h, m - end * h) for m, h in ranges[: data.channels]]
            shape = tuple(
                level
                for high, low in levels
                for level in ((high, low) if side == 0 else (high,) if side > 0 else (low,))
            )
            components.append(make_saturation(f"{place}/saturation@{name}{end},{knee}", side)((*shape, knee)))
    return components


def _levels(first: State, shape: tuple[float, ...], side: int) -> tuple[tuple[str, str, float], ...]:
    """The outputs at which saturation begins, from its specific forces, g; the end of the outputs on the other side.

    And the width of the bend, the last value of the shape.
    """
    gain = float(np.mean([abs(np.polyfit(f, v, 1)[0]) for f, v in zip(first.force.T, first.response, strict=False)]))
    start_values: list[tuple[str, str, float]] = [("knee", "", gain * abs(shape[-1]))]
    for k, axis in enumerate(first.data.axes):
        slope, offset = np.polyfit(first.force[:, k], first.response[k], 1)
        outputs = first.data.outputs[k]
        ends = {"high": outputs.max(), "low": outputs.min()}
        levels = shape[2 * k : 2 * k + 2] if side == 0 else shape[k : k + 1]
        start_values += [
            (name, axis, float(ends[name])) for name in ends if side and name != ("high" if side > 0 else "low")
        ]
        names = ("high", "low") if side == 0 else ("high",) if side > 0 else ("low",)
        start_values += [(name, axis, float(slope * a + offset)) for name, a in zip(names, levels, strict=True)]
    return tuple(start_values)


def _saturation_columns(shape: tuple[float, ...], side: int) -> Columns:
    """Loss of output above the high level and below the low one of each channel, g; one share for all levels.

    `shape`: the levels, and the width of the bend there.

    Often a single pose at the end of an axis's range shows a level: so the share of loss is common to all ends.
    """

    levels, knee = shape[:-1], abs(shape[-1])

    def columns(s: State) -> Array:
        matrices = np.zeros((s.data.channels, s.data.n, 1))
        for k in range(s.data.channels):
            a = s.force[:, k]
            gain = float(np.polyfit(a, s.response[k], 1)[0]) if np.ptp(a) > 0 else 1.0
            if side == 0:
                clipped = beyond(a - levels[2 * k], knee) - beyond(levels[2 * k + 1] - a, knee)
            else:
                clipped = side * beyond(side * (a - levels[k]), knee)
            matrices[k, :, 0] = gain * clipped
        return matrices

    return columns


def _cross_axis_components(data: PoseData, first: State) -> list[Component]:
    c = data.channels
    cross, z = first.force[:, list(CROSS)], out_of_plane(first.force)
    inclinations = len(np.unique(np.round(first.force[:, 2], 3)))

    def component(place: str, cause: str, basis: Basis, price: float = 0.0) -> Component:
        return Component(f"{place}/{cause}", place, "response", cause, price=price, columns=per_axis(basis))

    def curve(
        place: str, driver: str, forces: Array, intervals: int, factor: Factor = "", price: float = 0.0
    ) -> Component:
        return free(Form(place, "curve", driver, _splines_over(forces, c, intervals), factor), first, price=price)

    components = [
        component("cross-response", "cross-axis-bias", lambda s, k: s.force[:, CROSS[k], None] ** 2),
        curve("cross-response", "cross", cross, 14),
        component(
            "scale-over-cross", "cross-axis-scale",
            lambda s, k: (s.force[:, k] * s.force[:, CROSS[k]])[:, None], PRODUCT,
        ),
        curve("scale-over-cross", "cross", cross, 14, "force", PRODUCT),
    ]  # fmt: skip
    if inclinations < FEWEST_INCLINATIONS - 1:
        return components

    def square(s: State, k: int) -> Array:
        return out_of_plane(s.force)[:, k, None] ** 2

    def scaled(s: State, k: int) -> Array:
        perpendicular = out_of_plane(s.force)[:, k]
        return np.column_stack([s.force[:, k] * perpendicular, s.force[:, k] * perpendicular**2])

    components += [
        component("z-response", "z-axis-bias", square),
        component("scale-over-z", "z-axis-scale", scaled, PRODUCT),
    ]
    if inclinations >= FEWEST_INCLINATIONS:
        components += [
            curve("z-response", "out-of-plane", z, 10),
            curve("scale-over-z", "out-of-plane", z, 10, "force", PRODUCT),
        ]
    return components


def _history(data: PoseData, first: State) -> list[Component]:
    """Slip elements with free weights, slip elements pressed by the other axis, and branches."""
    if not data.sides:
        return []
    has_approach = "approach_deg" in data.table.constants
    start_shape = (STATED_APPROACH if has_approach else LOGGED_DEG,)
    components = [
        _make_slip(first, "slip", "", has_approach)(start_shape),
        _make_slip(first, "pressed-slip", "pressed", has_approach)(start_shape),
    ]
    components.append(_loops(first, has_approach)(start_shape))
    cross, own_force = first.force[:, list(CROSS)], first.force
    for approach, turn in data.sides.items():
        if np.ptp(turn) == 0:
            continue
        for name, driver, forces in (("branch-over-cross", "cross", cross), ("branch-over-own", "own", own_force)):
            splines = _splines_over(forces, data.channels, 10)
            form = Form("history", f"{name}-{SIDES[approach]}", driver, splines, "side", approach_deg=approach)
            components.append(free(form, first, "hysteresis", PRODUCT))
        friction = Form("history", f"friction-{SIDES[approach]}", "cross", (Ramp(),), "side", approach_deg=approach)
        components.append(free(friction, first, "hysteresis", constants=(("approach_deg", approach),)))
    return components


def _make_slip(first: State, name: str, factor: Factor, has_approach: bool) -> Make:
    """Slip elements; the shape is the angle in degrees before a pose at which its approach starts."""

    def at(shape: tuple[float, ...]) -> Component:
        widths = Play(WIDTHS_G, memory=not factor and first.data.timed)
        approach = STATED_APPROACH if has_approach else abs(shape[0])
        form = Form("history", name, "way", (widths,), factor, approach_deg=approach)
        return free(form, first, "hysteresis", PRODUCT if factor else 0.0, shape=shape, step=(2.0,),
                    reshaped=None if has_approach else _make_slip(first, name, factor, has_approach),
                    constants=(("approach_deg", approach),))  # fmt: skip

    return at


def _loops(first: State, has_approach: bool) -> Make:
    """Hysteresis with loops that depend on the force; the shape is the start of the approach, degrees before a pose."""

    def at(shape: tuple[float, ...]) -> Component:
        approach = STATED_APPROACH if has_approach else abs(shape[0])
        reach = 1.05 * float(np.abs(first.force).max())
        basis = Preisach(LOOPS_G, -reach, reach, LOOP_INTERVALS)
        form = Form("history", "loops", "way", (basis,), approach_deg=approach)
        return free(form, first, "hysteresis", GENERAL, constants=(("approach_deg", approach),))

    return at


def _over_beta(data: PoseData, first: State) -> list[Component]:
    """Bias over the angle beta of the stage, whatever the force: a field of the room, a cable that winds up.

    At one inclination the force is a function of beta as well, so that other inclinations must tell them apart.
    """
    inclinations, angles = (len(np.unique(np.round(np.mod(a, 2 * np.pi), 3))) for a in (data.alpha, data.beta))
    if inclinations < FEWEST_INCLINATIONS or angles <= FEWEST_ANGLES:
        return []
    turning = Form("beta-bias", "curve", "beta", (Harmonics(1, 6),))
    components = [free(turning, first, price=GENERAL, general=True)]
    if np.ptp(data.beta) > np.pi:
        components.append(
            free(Form("beta-bias", "winding", "beta", (spline(data.beta, 10),)), first, price=GENERAL, general=True)
        )
    return components


def _general(first: State) -> list[Component]:
    """Polynomials on the sphere that are no sum of functions of single axes."""
    return [free(Form("force", "curve", "force", (Products(DEGREE),)), first, price=GENERAL)]
