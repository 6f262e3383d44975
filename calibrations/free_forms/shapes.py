"""The likeliest shapes of components: values in which columns are not linear, such as a level or a time constant."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from calibrations.free_forms.chain import State
from calibrations.free_forms.components import Component
from calibrations.free_forms.reml import Gram, Sizes, gain_of_columns, without
from calibrations.table import Array


def refine_shapes(
    components: Sequence[Component], state: State, white: Array, X: Array, g: Gram, sizes: Sizes
) -> list[Component] | None:
    """The components, the acting ones at their likeliest shapes, the others held; None: no change.

    X, g   whitened columns [base, components, data] at `state` and their products; `sizes` of those that act
    """
    refined = list(components)
    for i, comp in enumerate(components):
        if comp.name not in sizes.variances or comp.reshaped is None:
            continue
        gain = gain_of_columns(g, without(g, sizes, comp.name), X, len(g.base_inverse))

        def gained(shape: tuple[float, ...], comp: Component = comp, gain: Callable[[Array], float] = gain) -> float:
            assert comp.reshaped is not None  # noqa: S101 checked above
            J = comp.reshaped(shape).jacobian(state) / g.scales[comp.name] / white[:, :, None]
            return gain(J.reshape(-1, J.shape[2]))

        best = climb(gained, comp.shape, comp.step)
        if best != comp.shape:
            refined[i] = comp.reshaped(best)
    changed = any(new is not old for new, old in zip(refined, components, strict=True))
    return refined if changed else None


def climb(
    gained: Callable[[tuple[float, ...]], float], shape: tuple[float, ...], step: tuple[float, ...]
) -> tuple[float, ...]:
    """The shape of greatest gain nearby: each value in turn, by a parabola through three points, steps halved."""
    best, top = list(shape), gained(shape)
    for _ in range(3):
        for k in range(len(best)):
            size = step[k]
            for _ in range(5):
                sides = []
                for sign in (-1.0, 1.0):
                    trial = tuple(v + sign * size if j == k else v for j, v in enumerate(best))
                    sides.append((gained(trial), trial))
                value, trial = max(sides)
                if value > top:
                    top, best = value, list(trial)
                else:
                    size *= 0.4
        step = tuple(0.2 * s for s in step)
    return tuple(best)
