"""The structure of a sensor's error: places that act, catalogue effects that are their causes, and the noise floor."""

from __future__ import annotations

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from scipy.optimize import nnls
from scipy.special import chdtri  # scipy.stats takes 0.4 s to load

from calibrations.criteria import LARGER_NOISE, LEAST_NOISE, SIGNIFICANT
from calibrations.free_forms.acting_places import ActingPlace, places
from calibrations.free_forms.bases import StraightLine
from calibrations.free_forms.chain import Coefficients, ModelEffects
from calibrations.free_forms.form import CROSS, Form
from calibrations.free_forms.geometry import LINEAR_PART, Geometry, GeometryEffects, geometry
from calibrations.free_forms.naming import is_over_soon, is_unsettled
from calibrations.free_forms.place_names import HISTORY, place_of_effect
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.saw import SAW
from calibrations.free_forms.search import search
from calibrations.free_forms.search_result import SearchResult
from calibrations.free_forms.selection import ENTER
from calibrations.free_forms.stairs import Stairs
from calibrations.geometry.orientation import out_of_plane
from calibrations.geometry.smooth import smooth_columns
from calibrations.means.noise import neighbour_std, neighbours_contradict, robust_std
from calibrations.table import Array, Table

FLOOR_ROUNDS = 2  # in which the noise floor is found from the residual
NO_NOISE = 1e-3  # of the noise of all rows: all samples of a mean are one code of the converter
RESOLVED = 1e-9  # of the range of an output: no converter resolves less, and rounding of numbers is no noise
LEAST_WHITE = 0.1  # the same: the noise that such a mean is given, though its samples show none
OUTLYING = 4.0  # times the usual residual: more counts as so much
SEEN_FORM = 0.9  # of a place's variance: the form of the catalogue itself, not one near it
KEPT = 0.1  # noise floors: rough columns that together add less are left out of a form
STAGE_ANGLES = frozenset({"stage-angle-alpha", "stage-angle-beta"})
LINEAR = {"cross-response": "cross", "z-response": "out-of-plane"}  # places with a linear part, and their drivers


class FloorSource(StrEnum):
    """Where the noise of a mean is known from."""

    SAMPLES = "the standard deviation and the number of samples of each mean"
    NEIGHBOURS = "neighbouring poses differ by so much, and the noise of a mean is not stated"
    ROUNDED = "the means are logged in steps so large that noise moves them from one code to the next"
    CONTRADICTED = "the standard deviations of the samples contain more than noise"


@dataclass(frozen=True, eq=False)
class Structure:
    """What a search found. `white` (channels, n): the noise of each mean that it used; `floor_source` says why."""

    result: SearchResult
    places: tuple[ActingPlace, ...]
    geometry: Geometry
    white: Array
    floor_source: FloorSource

    @property
    def causes(self) -> tuple[str, ...]:
        """Catalogue effects that are named, the largest place first.

        An effect that the data cannot separate from a larger cause is not named: one mechanism has one name. If a
        larger place is unknown, an effect is named only if its own form is visible (not one that follows most curves),
        and a geometry only if it is larger than the linear part that the unknown curve may have.
        """
        largest = max((place.size for place in self.unknown), default=0.0)
        least_own = max((place.own for place in self.unknown), default=0.0)
        cause_names: list[str] = []
        for place in sorted(self.places, key=lambda p: -p.own):  # of two that share a curve, the one that explains more
            is_larger = place.size >= largest and place.own >= least_own
            if place.material and (is_larger or (place.share >= SEEN_FORM and not self._follows(place))):
                cause_names += [c for c in place.causes if not self._is_confounded(c, cause_names)]
        by_size = [c for place in self.places for c in place.causes if c in cause_names]
        visible = [c for c in self.geometry.causes if self.geometry.sizes[c] >= LINEAR_PART * largest]
        return tuple(dict.fromkeys([*by_size, *visible]))

    def _follows(self, place: ActingPlace) -> bool:
        """Whether a place acts by components that follow many things: branches, slip elements, a random walk."""
        return place.name == HISTORY or any("/walk-" in name for name in place.components)

    def _is_confounded(self, cause: str, cause_names: list[str]) -> bool:
        """Whether the data cannot separate a cause from one of those that are named, or from its place."""
        alternatives = set(self.alternatives.get(cause, ()))
        places_of_named = {
            place.name for place in self.places if set(cause_names) & set(place.causes) and cause not in place.causes
        }
        places_of_named |= self._places_of_larger_offsets(cause)
        return bool(alternatives & (places_of_named | set(cause_names))) or any(
            cause in self.alternatives.get(named_cause, ()) for named_cause in cause_names
        )

    def _places_of_larger_offsets(self, cause: str) -> AbstractSet[str]:
        """The places of the stages' angles, where the stages' zero offsets are larger than the place of a cause."""
        size = max((place.size for place in self.places if cause in place.causes), default=np.inf)
        return STAGE_ANGLES if self.geometry.sizes.get("stage-zero-offset", 0.0) > size else frozenset()

    @property
    def follows_noise(self) -> bool:
        """Whether unseen rows differ by noise over time that no curve predicts: a random walk, or strong flicker."""
        return self.result.setting.flicker or any("/walk-" in name for name in self.result.active)

    @property
    def unknown(self) -> tuple[ActingPlace, ...]:
        """Places that act without a catalogue effect as their cause."""
        return tuple(place for place in self.places if place.unknown)

    @property
    def alternatives(self) -> dict[str, tuple[str, ...]]:
        """By cause, what the data cannot separate from it."""
        alternatives_by_cause = {
            c: p.inseparable_from for p in self.places if p.material for c in p.causes if p.inseparable_from
        }
        for cause, alternative in self._transients.items():
            alternatives_by_cause[cause] = tuple(sorted({*alternatives_by_cause.get(cause, ()), alternative}))
        return alternatives_by_cause | dict(self.geometry.alternatives or {})

    @property
    def _transients(self) -> dict[str, str]:
        """Warm-ups that a hysteresis explains as well, as they are over soon, or a drift, as they are not over."""
        if not self.result.data.timed:
            return {}
        t = self.result.data.elapsed_share
        acts = any("hysteresis" in place.causes for place in self.places)
        alternatives: dict[str, str] = {}
        for place in self.places:
            warm_ups = [cause for cause in place.causes if cause.startswith("warm-up")]
            if acts and warm_ups and is_over_soon(place.curve, t):
                alternatives |= dict.fromkeys(warm_ups, "hysteresis")
            elif "warm-up-bias" in warm_ups and "bias-drift" not in place.causes and is_unsettled(place.curve, t):
                alternatives["warm-up-bias"] = "bias-drift"
        return alternatives

    def others(self, place: ActingPlace | None) -> Array:
        """Contribution of all places but one to the output, (channels, n), in its unit; None: of all places."""
        result = self.result
        coefficients = {name: result.values.of[name] for name in (place.components if place else ())}
        state = result.setting.state_at(Coefficients(result.values.base, coefficients), result.components)
        return result.state.predicted - state.predicted

    def refinements(self, place: ActingPlace) -> tuple[str, ...]:
        """Catalogue effects that act at a place, without a free form of theirs, and are not its causes."""
        acting_components = [self.result.component(name) for name in place.components]
        return tuple(c.cause for c in acting_components if c.cause and c.form is None and c.cause not in place.causes)

    def constants(self, cause: str) -> dict[str, float]:
        """Constants by which a catalogue effect is the function that was found."""
        for place in self.places:
            if cause in place.causes and place.constants:
                return dict(place.constants)
            for name in place.components:
                component = self.result.component(name)
                if component.cause == cause and component.constants:
                    return dict(component.constants)
        return {}

    def starts(self, cause: str) -> tuple[tuple[str, str, float], ...]:
        """Values of a cause's parameters from which its fit starts: (parameter, axis or "", value)."""
        for component in (self.result.component(name) for place in self.places for name in place.components):
            if component.cause == cause and component.starts is not None:
                return component.starts(self.result.values.of[component.name])
        return ()

    def forms(self, place: ActingPlace) -> tuple[Form, ...]:
        """The free forms that act at a place, with their sizes."""
        forms = tuple(self._sized(name) for name in place.components if self.result.component(name).form is not None)
        return (*forms, *self._line(place.name))

    @property
    def free_forms(self) -> tuple[tuple[Form, ...], ...]:
        """The free forms of each place, the largest place first; last linear parts of places without a curve."""
        acting_places = {place.name for place in self.places}
        curves = [self.forms(place) for place in self.places]
        return tuple(filter(None, [*curves, *(self._line(name) for name in LINEAR if name not in acting_places)]))

    def _line(self, place: str) -> tuple[Form, ...]:
        """The linear part of what acts over another axis, where geometry alone does not bear it."""
        if place not in LINEAR or place not in self.geometry.lines:  # a form over beta has its first wave in itself
            return ()
        state, c = self.result.state, self.result.data.channels
        forces = state.force[:, list(CROSS)] if place == "cross-response" else out_of_plane(state.force)
        lines = tuple(StraightLine(float(forces[:, k].min()), float(forces[:, k].max())) for k in range(c))
        size = 2 * self.geometry.lines[place]
        return (Form(place, "line", LINEAR[place], lines, sizes=(size,) * c, kept=(1,)),)

    def _sized(self, name: str) -> Form:
        form, block = self.result.component(name).form, self.result.gram.blocks[name]
        assert form is not None  # noqa: S101 the caller asks for forms only
        variance, scale = self.result.sizes.variances[name], self.result.gram.scales[name]
        channels = 1 if form.shared else self.result.data.channels
        b = self.result.setting.base_size
        columns = self.result.columns[:, b + block.start : b + block.stop]
        mean_squares = (
            self.result.sizes.of(self.result.gram, name) ** 2 * np.sum(columns**2, axis=0) / self.result.data.n
        )
        return with_size(form, float(np.sqrt(variance) / scale), mean_squares, channels)


def with_size(form: Form, size: float, mean_squares: Array, channels: int) -> Form:
    """A form with its size, and with those columns of each axis that add something.

    added     mean square of what each column adds, in noise floors, the axes one after another
    channels  axes that have a function of their own; 1 where one is for all
    """
    start = 0
    sizes, counts = [], []
    for k in range(channels):
        count = form.count(k)
        tail_squares = np.cumsum(mean_squares[start : start + count][::-1])[::-1]  # from each column on
        is_indivisible = form.basis(k).kind in ("clips", "steps", "play", "preisach", "products", "ramp")
        sizes.append(size if count else 0.0)
        counts.append(count if is_indivisible else max(min(count, 1), int(np.sum(tail_squares > KEPT**2))))
        start += count
    return replace(form, sizes=tuple(sizes), kept=tuple(counts))


def with_stairs(structure: Structure, residual: Array, stairs: Stairs, white: Array) -> Structure:
    """The structure of the outputs before their rounding, with the converter's stairs as one more cause.

    left    residual of the linear model, (channels, n), whose part that the stairs may be is their curve
    white   of each mean, (channels, n): sizes are counted in it again
    """
    floor = float(np.sqrt(np.mean(white**2)))
    size = stairs.rms / floor
    largest = max([size, *(place.rms / floor for place in structure.places)])
    places = [
        replace(p, size=p.rms / floor, own=p.own * p.rms / (floor * p.size), largest=largest)
        for p in structure.places
        if p.name != "output"
    ]
    output_place = next((p for p in structure.places if p.name == "output"), None)
    causes = ("quantisation", *(output_place.causes if output_place and output_place.material else ()))
    components, gain = (
        (output_place.components, output_place.gain)
        if output_place
        else ((), 2 * residual.size * float(np.log1p(size)))
    )
    curve = np.clip(residual, -stairs.step / 2, stairs.step / 2)
    places.append(ActingPlace("output", size, size, largest, components, causes, 1.0, True, gain, (), curve))
    return replace(structure, places=tuple(sorted(places, key=lambda p: -p.size)), white=white)


def find_structure(
    table: Table,
    white: Array | None,
    model_effects: ModelEffects,
    effects: GeometryEffects,
    source: FloorSource = FloorSource.SAMPLES,
) -> Structure:
    """Places that act in poses, rows in order of time.

    white    standard deviation of each mean, (channels, n); None where it is not known
    model_effects    effects of the given model beyond bias, scale factor and geometry
    effects  those of the geometry
    source   where `white` is known from: noise that an earlier search of these rows found is not asked again
    """
    data, found_before = PoseData.of(table), source is not FloorSource.SAMPLES
    if white is None:
        white, source = _neighbours(data), FloorSource.NEIGHBOURS
    usual = np.sqrt(np.mean(white**2, axis=1, keepdims=True))
    if np.any(noiseless := white < NO_NOISE * usual):  # these rows have less noise than others, and contradict nothing
        result = search(data, np.where(noiseless, LEAST_WHITE * usual, white), model_effects)
    elif found_before or SAW in table.left_out:  # what the stairs hide of each row is never the same for all
        result = search(data, white, model_effects)
    else:
        result, source = _search_with_noise(data, white, model_effects, source)
    white = result.white
    result, factor = _in_larger_noise(result, model_effects)
    acting_places = places(result)
    shape = geometry(result, _curves(acting_places), effects)
    scaled_places = [
        replace(p, size=p.size * factor, own=p.own * factor, largest=p.largest * factor) for p in acting_places
    ]
    return Structure(result, tuple(scaled_places), shape, white, source)


def _curves(acting_places: Sequence[ActingPlace]) -> dict[str, Array]:
    """The curve of each place that acts, and of each place at which an inseparable effect may act in its stead."""
    curves = {place.name: place.curve for place in acting_places}
    for place in acting_places:
        for alternative_place in filter(None, map(place_of_effect, place.inseparable_from)):
            curves.setdefault(alternative_place, place.curve)
    return curves


def _search_with_noise(
    data: PoseData, white: Array, model_effects: ModelEffects, source: FloorSource
) -> tuple[SearchResult, FloorSource]:
    """The search, and where its noise is known from: again with the noise of the residual where that contradicts.

    Components that can follow almost anything wait until the noise is known, because they follow noise as well; not
    one that already acts in noise that is too large.
    """
    result = search(data, white, model_effects)
    noise = _scatter(result, source, uniform=True)
    if noise is None:
        return result, source
    source = FloorSource.CONTRADICTED if source is FloorSource.SAMPLES else source
    general = result.ratio < LEAST_NOISE and any(result.component(name).general for name in result.active)
    for number in range(1, FLOOR_ROUNDS + 1):
        reason = f"with the noise of the residual, round {number}, "
        origin = result if number > 1 and result.leaves_noise else None  # else its places are uncertain
        result = search(data, noise, model_effects, general=general, reason=reason, origin=origin)
        next_noise = _scatter(result, source, uniform=False)
        if next_noise is None:
            break
        noise = next_noise
    if not general and not result.leaves_noise:
        result = search(data, noise, model_effects, reason="with the noise of the residual and every component, ")
    return result, source


def _in_larger_noise(result: SearchResult, model_effects: ModelEffects) -> tuple[SearchResult, float]:
    """The search with noise as large as its residual, if that is likelier, and the factor on the noise; else 1.

    Scatter that nothing explains makes every component significant that follows it a little.
    """
    best, white = (result.criterion, result, 1.0), result.white
    factor = 1.0
    for number in range(1, FLOOR_ROUNDS + 1):
        factor *= best[1].ratio
        if best[1].ratio < LARGER_NOISE:
            break
        reason = f"with larger noise, round {number}, "
        larger = search(result.data, factor * white, model_effects, noise_known=False, reason=reason)
        scale = 2 * (larger.gram.rows - larger.gram.base_rank) * float(np.log(factor))
        if larger.criterion + scale + ENTER >= best[0]:
            break
        best = larger.criterion + scale + ENTER, larger, factor
    return best[1], best[2]


def _neighbours(data: PoseData) -> Array:
    """White noise from second differences of neighbouring poses, the same for all rows of an axis.

    Smooth functions of the angles are removed first: they differ from pose to pose as noise does.
    """
    smooth = np.column_stack([np.ones(data.n), smooth_columns(data.table)])
    y = data.outputs - (smooth @ np.linalg.lstsq(smooth, data.outputs.T, rcond=1e-9)[0]).T
    if data.n < 5:
        return np.full(y.shape, float(np.std(y)) or 1.0)
    return np.asarray(np.maximum(np.tile(neighbour_std(y)[:, None], (1, data.n)), _find_smallest_noise(data)))


def _find_smallest_noise(data: PoseData) -> Array:
    """The smallest noise that data can show, per channel, (channels, 1)."""
    return np.asarray(RESOLVED * np.ptp(data.outputs, axis=1, keepdims=True))


def _scatter(result: SearchResult, source: FloorSource, uniform: bool) -> Array | None:
    """White noise as the residual has it; None where the noise that was used agrees.

    Noise from the samples is only replaced where the residual is clearly smaller: a larger one may hold more effects.
    Rows are `uniform` at first: what follows the samples' variance may be an effect that the search has not seen yet.
    """
    residual = result.residual
    ratio = result.ratio
    differ_less = neighbours_contradict(residual.reshape(result.white.shape) * np.sqrt(residual.size / result.freedom))
    agrees = ratio > LEAST_NOISE and not differ_less and not _noisy_rows_contradict(result)
    if agrees and (source is FloorSource.SAMPLES or ratio < 1 / LEAST_NOISE):
        return None
    r = residual.reshape(result.white.shape) * result.white
    white = np.stack([_rows_noise(result, k, row, uniform) for k, row in enumerate(r)])
    white = np.maximum(white * np.sqrt(residual.size / result.freedom), _find_smallest_noise(result.data))
    return white if np.all(white > 0) and not np.array_equal(white, result.white) else None


def _noisy_rows_contradict(result: SearchResult) -> bool:
    """Whether rows with more noise than the rms of all rows have a clearly smaller residual than their noise.

    A misfit of the other rows, which weigh more, hides this in the ratio of all rows.
    """
    white, residual = result.white, result.residual.reshape(result.white.shape)
    noisy = white > np.sqrt(np.mean(white**2, axis=1, keepdims=True))
    rows = int(noisy.sum())
    squares = float(np.sum(residual[noisy] ** 2)) * residual.size / result.freedom
    return rows > 0 and squares < min(LEAST_NOISE**2 * rows, float(chdtri(rows, 1 - SIGNIFICANT)))


def _rows_noise(result: SearchResult, k: int, residual: Array, uniform: bool) -> Array:
    """Noise of each row of one channel, (n,): a constant part, and parts that follow the samples' variance."""
    usual = robust_std(residual - np.median(residual))
    spread = result.data.spread
    if uniform or spread is None or np.ptp(spread[k]) == 0:
        return np.full(len(residual), min(usual, neighbour_std(residual[None])[0]))
    power = spread[k] ** 2 / np.mean(spread[k] ** 2)
    shares = np.column_stack([np.ones(len(residual)), power, power**2])  # the last: an effect of a noisy variance
    variance = np.full(len(residual), np.inf)
    for _ in range(3):
        squares = np.minimum(residual**2, OUTLYING**2 * variance)
        variance = shares @ nnls(shares / usual**2, squares / usual**2)[0]
    return np.asarray(np.sqrt(variance))
