"""The places of the signal chain, and the components that live at each: catalogue forms and curves.

Every component is normalised to unit rms at the start of a search (`reml.gram`), so that a variance is the mean square
of what it adds to the output. Constant and linear parts over the forces are in the base (`chain`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.signal import savgol_filter

from tests.benchmark.free_forms.bases import harmonics, play, spline, waves
from tests.benchmark.free_forms.chain import Component, State
from tests.benchmark.free_forms.measurement import Array, Measurement, specific_force

PRODUCT, GENERAL = 2.0, 8.0  # prices: simple before product before general force
WIDTHS_G = np.geomspace(0.01, 1.8, 14)  # of slip elements
APPROACH_DEG = 5.0  # before a pose that a move does not reach from the logged side: to begin with
DEAD_G = (0.003, 0.012, 0.05)
ENDS = (0.75, 0.9, 0.97, 0.99)  # of an axis's range, where saturation begins
WARMING = (0.04, 0.15, 0.6)  # of the record: time constants
LAGS_S = (0.0, -90.0, 90.0)  # by which the sensor is ahead of the thermometer
FLICKER_WAVES, WALK_WAVES = 24, 24
DEGREE = 4  # of a general function of the force's direction
PLAYS_K = (0.05, 0.15, 0.35)  # of the range of temperatures

Basis = Callable[[State, int], Array]  # (n, m) of one channel


def per_axis(basis: Basis) -> Callable[[State], Array]:
    """Columns of each channel's own function: zero in the other channels."""

    def columns(state: State) -> Array:
        blocks = [np.atleast_2d(basis(state, k)) for k in range(state.data.channels)]
        out = np.zeros((len(blocks), state.data.n, sum(b.shape[1] for b in blocks)))
        at = 0
        for k, block in enumerate(blocks):
            out[k, :, at : at + block.shape[1]] = block
            at += block.shape[1]
        return out

    return columns


def candidates(data: Measurement, first: State) -> list[Component]:
    """Every component that this measurement can show."""
    return [
        *_slow_noise(data),
        *_stages(data),
        *_own(data, first),
        *_other_axes(data, first),
        *_history(data, first),
        *_temperature(data),
        *_time(data),
        *_output(data, first),
        *_columns(data),
        *_general(data, first),
    ]


def _slow_noise(data: Measurement) -> list[Component]:
    """Flicker noise of each channel: never a cause, always in the model."""
    if not data.timed or data.n < 20:
        return []
    basis = waves(data.since, min(FLICKER_WAVES, data.n // 6), 1.0)
    out = []
    for k in range(data.channels):
        columns = np.zeros((data.channels, *basis.shape))
        columns[k] = basis
        out.append(Component(f"noise/{data.axes[k]}", "noise", "response", columns=_fixed(columns), noise=True))
    return out


def _fixed(columns: Array) -> Callable[[State], Array]:
    return lambda state: columns


def _timed(basis: Array) -> Callable[[State], Array]:
    """A function of the row alone, for each axis one."""
    return per_axis(lambda state, k: basis)


def _times_force(basis: Array) -> Callable[[State], Array]:
    return per_axis(lambda state, k: state.force[:, k, None] * basis)


def _stages(data: Measurement) -> list[Component]:
    components: list[Component] = []
    beta = data.beta

    def angle(name: str, of: str, basis: Array, cause: str = "", price: float = 0.0) -> Component:
        return Component(f"stage-angle-{of}/{name}", f"stage-angle-{of}", of, cause, price=price, angle=lambda d: basis)

    if len(np.unique(np.round(np.mod(beta, 2 * np.pi), 3))) > 8:
        components.append(angle("stage-eccentricity", "beta", harmonics(beta, 1), "stage-eccentricity"))
        components.append(angle("curve", "beta", harmonics(beta, 9, least=2)))
        if len(np.unique(np.round(np.mod(beta, 2 * np.pi), 3))) > 33:
            components.append(angle("fine", "beta", harmonics(beta, 16, power=0.0, least=4), price=PRODUCT))
    for how, turn in data.sides.items():
        if np.ptp(turn) > 0:
            components.append(angle(f"stage-backlash@{how}", "beta", turn[:, None], "stage-backlash"))
            components.append(angle(f"turn-curve@{how}", "beta", turn[:, None] * harmonics(beta, 4), price=PRODUCT))
    alphas = np.unique(np.round(data.alpha, 4))
    if len(alphas) >= 4:
        shape = spline(data.alpha, most=10, order=1)
        components.append(angle("curve", "alpha", shape(data.alpha), price=PRODUCT))
    return components


def _own(data: Measurement, first: State) -> list[Component]:
    place = "own-response"

    def form(cause: str, basis: Basis, family: str = "", price: float = 0.0, shape: str = "") -> Component:
        return Component(f"{place}/{cause}{shape}", place, "response", cause, family, price, per_axis(basis))

    shapes = [spline(first.force[:, k], 22) for k in range(data.channels)]
    components = [
        form("quadratic-nonlinearity", lambda s, k: s.force[:, k, None] ** 2),
        form("cubic-nonlinearity", lambda s, k: s.force[:, k, None] ** 3),
        form("odd-quadratic-nonlinearity", lambda s, k: (s.force[:, k] * np.abs(s.force[:, k]))[:, None]),
        form("scale-factor-asymmetry", lambda s, k: np.abs(s.force[:, k, None])),
        Component(f"{place}/curve", place, "response", columns=per_axis(lambda s, k: shapes[k](s.force[:, k]))),
    ]
    price = 2 * np.log(len(DEAD_G))

    def dead(name: str) -> Callable[[tuple[float, ...]], Component]:
        return lambda shape: Component(
            name, place, "response", "dead-zone", f"{place}/dead-zone", price, per_axis(_dead(shape)),
            shape=shape, step=tuple(0.3 * w for w in shape), reshaped=dead(name),
        )  # fmt: skip

    components += [dead(f"{place}/dead-zone@{width:.4f}")((width,) * data.channels) for width in DEAD_G]
    ranges = [(float(f.min() + f.max()) / 2, float(np.ptp(f)) / 2) for f in first.force.T]
    more = 2 * np.log(3 * len(ENDS))

    def saturated(name: str, side: int) -> Callable[[tuple[float, ...]], Component]:
        return lambda shape: Component(
            name, place, "response", "saturation", f"{place}/saturation", more, _saturated(shape, side),
            shape=shape, step=(0.02,) * len(shape), reshaped=saturated(name, side),
        )  # fmt: skip

    for side, name in ((1, "high"), (-1, "low"), (0, "both")):
        for end in ENDS:
            levels = [(m + end * h, m - end * h) for m, h in ranges[: data.channels]]
            shape = tuple(
                level
                for high, low in levels
                for level in ((high, low) if side == 0 else (high,) if side > 0 else (low,))
            )
            components.append(saturated(f"{place}/saturation@{name}{end}", side)(shape))
    return components


def _dead(widths: tuple[float, ...]) -> Basis:
    """Specific force clipped at a width of each channel's own, g."""
    return lambda s, k: np.clip(s.force[:, k, None], -widths[k], widths[k])


def _saturated(levels: tuple[float, ...], side: int) -> Callable[[State], Array]:
    """What is lost above the high level and below the low one of each channel, g; one share for all of it.

    One pose at the end of an axis's range may be all that shows a level: the share lost is common to all ends.
    """

    def columns(s: State) -> Array:
        out = np.zeros((s.data.channels, s.data.n, 1))
        for k in range(s.data.channels):
            a = s.force[:, k]
            gain = float(np.polyfit(a, s.response[k], 1)[0]) if np.ptp(a) > 0 else 1.0
            if side == 0:
                lost = np.maximum(a - levels[2 * k], 0.0) + np.minimum(a - levels[2 * k + 1], 0.0)
            else:
                lost = np.maximum(a - levels[k], 0.0) if side > 0 else np.minimum(a - levels[k], 0.0)
            out[k, :, 0] = gain * lost
        return out

    return columns


def _other_axes(data: Measurement, first: State) -> list[Component]:
    components: list[Component] = []
    n_z = len(np.unique(np.round(first.force[:, 2], 3)))
    near = [1, 0, 0]  # of x, y, z: the other axis in the plane

    def add(place: str, form: str, basis: Basis, curve: Basis | None, price: float) -> None:
        components.append(Component(f"{place}/{form}", place, "response", form, price=price, columns=per_axis(basis)))
        if curve is not None:
            components.append(Component(f"{place}/curve", place, "response", price=price, columns=per_axis(curve)))

    f = first.force
    over = [spline(f[:, near[k]], 14) for k in range(data.channels)]
    over1 = [spline(f[:, near[k]], 14, order=2) for k in range(data.channels)]
    add("cross-response", "cross-axis-bias", lambda s, k: s.force[:, near[k], None] ** 2,
        lambda s, k: over[k](s.force[:, near[k]]), 0.0)  # fmt: skip
    add("scale-over-cross", "cross-axis-scale", lambda s, k: (s.force[:, k] * s.force[:, near[k]])[:, None],
        lambda s, k: s.force[:, k, None] * over1[k](s.force[:, near[k]]), PRODUCT)  # fmt: skip
    if n_z >= 3:
        along = spline(f[:, 2], 10)
        enough = n_z >= 4
        add("z-response", "z-axis-bias", lambda s, k: s.force[:, 2, None] ** 2,
            (lambda s, k: along(s.force[:, 2])) if enough else None, 0.0)  # fmt: skip
        add("scale-over-z", "z-axis-scale",
            lambda s, k: np.column_stack([s.force[:, k] * s.force[:, 2], s.force[:, k] * s.force[:, 2] ** 2]),
            (lambda s, k: s.force[:, k, None] * along(s.force[:, 2])) if enough else None, PRODUCT)  # fmt: skip
    return components


def _history(data: Measurement, first: State) -> list[Component]:
    """Slip elements with free weights, the same pressed by the other axis, and branches."""
    if data.way is None or not data.sides:
        return []
    components = [
        _slipping(data, "hysteresis", False)((APPROACH_DEG,)),
        _slipping(data, "pressed", True)((APPROACH_DEG,)),
    ]
    for how, turn in data.sides.items():
        if np.ptp(turn) > 0:
            components += [
                _branches("friction", turn, how, first, [1, 0, 0], rigid=True),
                _branches("over-other", turn, how, first, [1, 0, 0]),
                _branches("over-own", turn, how, first, [0, 1, 2]),
            ]
    return components


def _branches(name: str, turn: Array, how: str, first: State, over: Sequence[int], rigid: bool = False) -> Component:
    """The side of the last move times a function of the force along some axis; `rigid`: constant and magnitude."""
    shapes = [spline(first.force[:, over[k]], 10) for k in range(first.data.channels)]

    def basis(s: State, k: int) -> Array:
        a = s.force[:, over[k]]
        if rigid:
            return np.asarray(turn[:, None] * np.column_stack([np.ones_like(a), np.abs(a)]))
        return np.asarray(turn[:, None] * np.column_stack([np.ones_like(a), a, shapes[k](a)]))

    return Component(f"history/{name}@{how}", "history", "response", "hysteresis", columns=per_axis(basis),
                     price=0.0 if rigid else PRODUCT)  # fmt: skip


def _slipping(data: Measurement, name: str, pressed: bool) -> Callable[[tuple[float, ...]], Component]:
    """Slip elements by how many degrees before a pose its approach begins."""
    assert data.way is not None
    way, nominal = data.way, _nominal(data)

    def at(shape: tuple[float, ...]) -> Component:
        held = play(nominal, way(abs(shape[0])), WIDTHS_G) / WIDTHS_G

        def basis(s: State, k: int) -> Array:
            other = np.abs(s.force[:, [1, 0, 0][k], None])
            return np.asarray(other * held[:, k, ::2] if pressed else held[:, k])

        return Component(
            f"history/{name}", "history", "response", "hysteresis", price=PRODUCT if pressed else 0.0,
            columns=per_axis(basis), shape=shape, step=(2.0,), reshaped=_slipping(data, name, pressed),
        )  # fmt: skip

    return at


def _nominal(data: Measurement) -> Array:
    return specific_force(data.alpha, data.beta + data.mount, data.flip, np.array([0.0, 0.0, 1.0]))


def smoothed(x: Array) -> Array:
    """A logged column without the noise of its instrument: a local line over some rows."""
    width = min(11, 2 * (len(x) // 4) + 1)
    return np.asarray(savgol_filter(x, width, 1)) if width >= 5 else x


def ahead(x: Array, time_s: Array, by_s: float) -> Array:
    """The column as it will be read so much later (earlier where negative), shape (n,)."""
    return np.interp(time_s + by_s, time_s, smoothed(x))


def _temperature(data: Measurement) -> list[Component]:
    temperature = data.temperature_c
    if temperature is None or np.ptp(temperature) == 0:
        return []
    components: list[Component] = []
    lags = LAGS_S if data.timed else (0.0,)
    late = 2 * np.log(len(lags))
    for place, make, more in (("temperature-bias", _timed, 0.0), ("temperature-scale", _times_force, PRODUCT)):
        for lag in lags:
            total = more + late if lag else more
            components.append(_warmer(data, f"{place}/{place}@{lag:g}", place, place, total, make, False)((lag,)))
        components.append(_warmer(data, f"{place}/curve", place, "", more, make, True)((0.0,)))
    if data.timed:
        for part in PLAYS_K:
            width = np.array([part * float(np.ptp(temperature))])
            T = smoothed(temperature)[:, None]
            held = play(T, T[:, None], width)[:, 0]
            name = f"temperature-bias/temperature-hysteresis@{part}"
            columns, price = _timed(held), 2 * np.log(len(PLAYS_K))
            components.append(
                Component(
                    name,
                    "temperature-bias",
                    "response",
                    "temperature-hysteresis",
                    "temperature-bias/play",
                    price,
                    columns,
                )
            )
    return components


def _warmer(
    data: Measurement, name: str, place: str, cause: str, price: float,
    make: Callable[[Array], Callable[[State], Array]], curved: bool,
) -> Callable[[tuple[float, ...]], Component]:  # fmt: skip
    """A line or a curve over the temperature that the thermometer will show so many seconds later."""
    assert data.temperature_c is not None
    temperature = data.temperature_c

    def at(shape: tuple[float, ...]) -> Component:
        T = ahead(temperature, data.time_s, shape[0]) if data.timed else temperature
        basis = spline(T, 8)(T) if curved else (T - T.mean())[:, None]
        return Component(
            name, place, "response", cause, f"{place}/{'curve' if curved else 'line'}", price, make(basis), shape=shape,
            step=(30.0,), reshaped=_warmer(data, name, place, cause, price, make, curved) if data.timed else None,
        )  # fmt: skip

    return at


def _time(data: Measurement) -> list[Component]:
    if not data.timed or data.n < 12:
        return []
    u = data.since
    components: list[Component] = []
    walk = waves(u, min(WALK_WAVES, data.n // 6), 2.0)
    shape = spline(u, 12)
    for place, make, cause, drift, more in (
        ("time-bias", _timed, "warm-up-bias", "bias-drift", 0.0),
        ("time-scale", _times_force, "warm-up-scale", "", PRODUCT),
    ):
        price = more + 2 * np.log(len(WARMING))
        for tau in WARMING:
            components.append(_warming(u, f"{place}/{cause}@{tau:.3f}", place, cause, price, make)((float(tau),)))
        components.append(
            Component(f"{place}/line", place, "response", drift, price=more, columns=make(u[:, None] - 0.5))
        )
        components.append(Component(f"{place}/curve", place, "response", price=more, columns=make(shape(u))))
        if drift:
            for k, axis in enumerate(data.axes):
                columns = np.zeros((data.channels, *walk.shape))
                columns[k] = walk
                components.append(Component(f"{place}/walk-{axis}", place, "response", drift, columns=_fixed(columns)))
    return components


def _warming(
    u: Array, name: str, place: str, cause: str, price: float, make: Callable[[Array], Callable[[State], Array]]
) -> Callable[[tuple[float, ...]], Component]:
    """An exponential approach by its time constant, as a share of the record."""
    return lambda shape: Component(
        name, place, "response", cause, f"{place}/{cause}", price, make(np.exp(-u / max(shape[0], 1e-3))[:, None]),
        shape=shape, step=(0.2 * shape[0],), reshaped=_warming(u, name, place, cause, price, make),
    )  # fmt: skip


def _output(data: Measurement, first: State) -> list[Component]:
    if data.channels < 2:
        return []
    low, high = float(data.outputs.min()), float(data.outputs.max())
    middle, half = (low + high) / 2, (high - low) / 2
    shape = spline(data.outputs.ravel(), 22)

    def powers(s: State) -> Array:
        u = (s.response - middle) / half
        return np.stack([u**2, u**3], axis=2)

    def curve(s: State) -> Array:
        return np.stack([shape(v) for v in s.response])

    return [
        Component("output/adc-nonlinearity", "output", "output", "adc-nonlinearity", columns=powers),
        Component("output/curve", "output", "output", columns=curve),
    ]


def saw(frequency: float, harmonics_: int, price: float) -> Component:
    """Quantisation: harmonics of a saw over the output, codes per unit of output."""

    def columns(s: State) -> Array:
        turned = 2 * np.pi * frequency * s.response[:, :, None] * np.arange(1, harmonics_ + 1)
        scale = 1.0 / np.arange(1, harmonics_ + 1)
        return np.concatenate([np.sin(turned) * scale, np.cos(turned) * scale], axis=2)

    name = f"output/quantisation@{frequency:.6g}"
    return Component(
        name, "output", "output", "quantisation", "output/quantisation", price, columns, shape=(frequency,)
    )


def _columns(data: Measurement) -> list[Component]:
    components: list[Component] = []
    if data.supply_v is not None and np.ptp(data.supply_v) > 0:
        more = (data.supply_v / data.supply_v.mean() - 1)[:, None]
        place = "column:supply_v"
        shape = spline(data.supply_v, 8)(data.supply_v)
        components += [
            Component(f"{place}/supply-sensitivity", place, "output", "supply-sensitivity",
                      columns=per_axis(lambda s, k: s.response[k, :, None] * more)),
            Component(f"{place}/curve", place, "response", columns=_timed(shape)),
            Component(f"{place}/line", place, "response", "", columns=_timed(more)),
            Component(f"{place}/scale-line", place, "response", price=PRODUCT, columns=_times_force(more)),
            Component(f"{place}/scale-curve", place, "response", price=PRODUCT, columns=_times_force(shape)),
        ]  # fmt: skip
    if data.std is not None and np.all(np.ptp(data.std, axis=1) > 0):
        squares = data.std**2
        place = "column:std"
        components.append(Component(f"{place}/vibration-rectification", place, "response", "vibration-rectification",
                               columns=per_axis(lambda s, k: (squares[k] - squares[k].mean())[:, None])))  # fmt: skip
        shapes = [spline(q, 6) for q in squares]
        components.append(
            Component(f"{place}/curve", place, "response", columns=per_axis(lambda s, k: shapes[k](squares[k])))
        )
    for name, x in data.logged.items():
        place = f"column:{name}"
        line = (x - x.mean())[:, None]
        components.append(Component(f"{place}/line", place, "response", columns=_timed(line)))
        components.append(Component(f"{place}/curve", place, "response", columns=_timed(spline(x, 8)(x))))
        components.append(
            Component(f"{place}/scale-line", place, "response", price=PRODUCT, columns=_times_force(line))
        )
    return components


def _general(data: Measurement, first: State) -> list[Component]:
    """Polynomials on the sphere that no sum of functions of single axes is: products of two axes and of three."""

    def monomials(s: State, k: int) -> Array:
        x, y, z = s.force.T
        return np.column_stack([
            x**i * y**j * z**m
            for m in (0, 1)
            for i in range(DEGREE + 1)
            for j in range(DEGREE + 1 - i)
            if 2 <= i + j + m <= DEGREE and (i > 0) + (j > 0) + (m > 0) > 1
        ])  # fmt: skip

    return [Component("force/curve", "force", "response", price=GENERAL, columns=per_axis(monomials))]
