"""Finds the places at which an effect acts, and the curve, the size and the causes of each.

A place also lists the effects that the data cannot separate from its causes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc  # scipy.stats takes 0.4 s to load

from calibrations.free_forms.jumps import STEPS
from calibrations.free_forms.naming import Curves, all_walk, causes_of_place, project_off
from calibrations.free_forms.place_names import HISTORY
from calibrations.free_forms.rivals import gain_and_rivals, replacements_of
from calibrations.free_forms.search_result import SearchResult
from calibrations.table import Array

LEAST_SIZE = 0.6  # noise floors: a smaller place is a refinement
LEAST_OWN = 0.3  # noise floors: part of a place with a cause that no other place explains, if the residual is noise
LEAST_SHARE = 0.015  # of the largest place's size
LEAST_BESIDE_LOOPS = 0.1  # of the size of a hysteresis in another form, of which slip elements leave a part
LEAST_BESIDE_STEPS = 0.1  # of the size of a converter's steps, for what has corners over the force as they have
LEAST_UNKNOWN = 1.0  # noise floors: size of a place whose cause is unknown
LEAST_UNKNOWN_SHARE = 0.05  # of the largest place's size: the part of such a place that no other one explains
READING_ERRORS = 1.5  # times the residual by the errors of noisy columns, whose size is uncertain
CANCELLED = 3.0  # of what the base leaves: a larger place is cancelled by another one, and neither has the true curve
FORM_OF = 0.25  # of another place's size: a place of which no more is its own may be a part of that place's form
ANY_CURVE = {"output": "adc-nonlinearity"}  # effects that are any curve at their place: IEEE 1241

PlaceSizes = Mapping[str, float]  # of each place, rms in noise floors


@dataclass(frozen=True)
class ActingPlace:
    """A place that acts: its size (rms over the poses, in floors), and its causes with the share that they explain.

    `own`: size of the part that no other place explains. `largest`: size of the largest place.
    """

    name: str
    size: float
    own: float
    largest: float
    components: tuple[str, ...]
    causes: tuple[str, ...]
    share: float
    material: bool
    gain: float
    inseparable_from: tuple[str, ...]
    curve: Array  # (channels, n), in the output's unit, without its projection on the base
    constants: tuple[tuple[str, float], ...] = ()  # of the cause, where it is that of another place

    @property
    def rms(self) -> float:
        """Size over the poses, in the output's unit."""
        return float(np.sqrt(np.mean(self.curve**2)))

    @property
    def p_value(self) -> float:
        """Chance of such a gain of one variance at its boundary: half of chi-square (Self and Liang, 1987)."""
        return float(chdtrc(1, max(self.gain, 0.0)) / 2)

    @property
    def unknown(self) -> bool:
        """Whether no effect of the catalogue is its cause, and it is no remainder of the form of a larger one."""
        visible = self.size >= LEAST_UNKNOWN and self.own >= LEAST_UNKNOWN_SHARE * self.largest
        return self.material and not self.causes and visible


def places(result: SearchResult) -> list[ActingPlace]:
    """Every place that acts, largest first."""
    b = result.setting.base_size
    by_place: dict[str, list[str]] = {}
    for name in result.active:
        by_place.setdefault(result.component(name).place, []).append(name)
    base = result.columns[:, :b]
    Q = np.linalg.qr(base / np.maximum(np.linalg.norm(base, axis=0), 1e-300))[0]
    curves = {
        place: project_off(Q, np.sum([_part(result, n, b) for n in names], axis=0)) for place, names in by_place.items()
    }
    sizes = {place: float(np.sqrt(np.mean(curve**2))) for place, curve in curves.items()}
    own_sizes = {place: _size_of_unshared_part(result, result.cost_without(names)) for place, names in by_place.items()}
    sizes |= {place: own_sizes[place] for place, curve in curves.items() if _is_cancelled(result, curve)}
    acting_places = [
        _acting_place(result, place, names, curves, sizes, own_sizes[place], Q) for place, names in by_place.items()
    ]
    return _with_substitutes(result, sorted(acting_places, key=lambda p: -p.size))


def _is_cancelled(result: SearchResult, curve: Array) -> bool:
    """Whether a place adds far more than there is to explain, which another place takes off again."""
    return float(curve @ curve) > CANCELLED**2 * result.gram.squares


def _acting_place(
    result: SearchResult, place: str, names: Sequence[str], curves: Curves, sizes: PlaceSizes, own: float, Q: Array
) -> ActingPlace:
    """One place, of which the components `names` act, with its causes and what the data cannot separate from them."""
    size, largest = sizes[place], max(sizes.values())
    causes, share, constants = causes_of_place(result, place, names, curves, Q)
    causes = () if _is_cancelled(result, curves[place]) else causes
    part = own if all(result.component(name).form for name in names) else size  # a curve was preferred to a known form
    gain, alternatives = gain_and_rivals(result, names, {other for other in sizes if part < FORM_OF * sizes[other]})
    replacements = [replacements_of(result, names, causes, cause) for cause in causes] if len(names) > 1 else []
    alternatives = tuple(sorted({*alternatives, *(name for each in replacements for name in each)} - set(causes)))
    least = _least_size(result, place, sizes)
    if all_walk(names):
        least = max(least, LEAST_UNKNOWN_SHARE * largest, READING_ERRORS * _reading_errors(result, sizes))
    elif STEPS in names:  # their positions are those of the residual: they also follow the corners of a larger place
        least = max(least, LEAST_UNKNOWN_SHARE * largest)
    # a place without a form of the catalogue, or smaller than the excess of the residual, is more often a remainder
    least_own = min(LEAST_SIZE, max(LEAST_OWN, _excess(result))) if causes else LEAST_SIZE
    material = own >= least_own and size >= max(least_own, least)
    curve = curves[place].reshape(result.white.shape) * result.white
    acting_place = ActingPlace(
        place, size, own, largest, tuple(names), causes, share, material, gain, alternatives, curve, constants
    )
    if place in ANY_CURVE and f"{place}/curve" in names and acting_place.unknown and not alternatives:
        return replace(acting_place, causes=(ANY_CURVE[place],))
    return acting_place


def _least_size(result: SearchResult, place: str, sizes: PlaceSizes) -> float:
    """The size from which a place counts beside the others.

    The scatter of the samples, which no force drives, is no remainder of the form of a larger place.
    """
    if place == "column:std":
        return 0.0
    least = LEAST_SHARE * max(sizes.values())
    if place == "own-response" and STEPS in result.active:
        least = max(least, LEAST_BESIDE_STEPS * sizes["output"])
    loops = [name for name in result.active if result.component(name).place == HISTORY]
    in_another_form = place != HISTORY and any(result.component(name).form is not None for name in loops)
    return max(least, LEAST_BESIDE_LOOPS * sizes[HISTORY]) if in_another_form else least


def _size_of_unshared_part(result: SearchResult, gain: float) -> float:
    """Size of the part that only this place explains, from its gain in likelihood, in noise floors."""
    return float(np.sqrt(max(gain, 0.0) / len(result.columns)))


def _excess(result: SearchResult) -> float:
    """The part of the residual above the noise, rms in noise floors."""
    return float(np.sqrt(max(result.ratio**2 - 1, 0.0)))


def _with_substitutes(result: SearchResult, acting_places: Sequence[ActingPlace]) -> list[ActingPlace]:
    """The places. If two explain most of each other, the larger one counts, and the smaller one is its alternative."""
    places_kept = list(acting_places)
    sizes = {place.name: place.size for place in acting_places}
    for i, place in enumerate(places_kept):
        least = max(LEAST_SIZE, _least_size(result, place.name, sizes))
        if (place.material and place.own >= LEAST_SIZE) or place.size < least:
            continue
        for substitute in (o for o in places_kept[i + 1 :] if not o.material):
            gain = result.cost_without((*place.components, *substitute.components))
            if _size_of_unshared_part(result, gain) >= LEAST_SIZE:
                names = substitute.causes or (substitute.name,)
                alternatives = tuple(sorted({*place.inseparable_from, *names} - set(place.causes)))
                places_kept[i] = replace(place, material=True, gain=gain, inseparable_from=alternatives)
                break
    return places_kept


def _reading_errors(result: SearchResult, sizes: Mapping[str, float]) -> float:
    """Residual by the errors of noisy columns at the places that they drive, rms over the noise."""
    driven = {result.component(name).place: result.component(name).error for name in result.active}
    return float(np.sqrt(sum((error * sizes[place]) ** 2 for place, error in driven.items())))


def _part(result: SearchResult, name: str, b: int) -> Array:
    """Contribution of one component to the output over the noise, (channels * n,)."""
    block = result.gram.blocks[name]
    return np.asarray(result.columns[:, b + block.start : b + block.stop] @ result.sizes.of(result.gram, name))
