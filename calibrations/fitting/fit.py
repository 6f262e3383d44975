"""Joint least-squares estimate of a model's parameters, with uncertainties that allow for slow noise.

Parameters and noise are estimated in turn: least squares under the present noise, then the noise of greatest
likelihood given the residual, until neither moves. Where the model does not describe the data, its parameters are less
certain than the noise alone makes them: standard uncertainties are widened by the Birge ratio.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from calibrations.errors import ModelError, UnknownName, nearest
from calibrations.fitting.held_out import folds, held_out, parameters_of_rows
from calibrations.fitting.identifiability import covariance, estimates
from calibrations.fitting.minimise import minimise
from calibrations.fitting.noise_fit import estimate, widening
from calibrations.fitting.problem import Problem
from calibrations.frames import data_frame
from calibrations.free_forms.place_names import PREFIX
from calibrations.means.noise import Noise, rms, white_only
from calibrations.model import Model
from calibrations.model.model import Parameters
from calibrations.result import Result
from calibrations.table import Array, Table
from calibrations.text import columns, quantity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from calibrations.presentation.chart import Picture

ROUNDS = 2
LEAST_FREEDOM = 3.0  # degrees: below, Student's t has no variance


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Result):
    """A model fitted to a table. `residual` has shape (channels, n), rows in order of time.

    `all_noise`: what standard uncertainties were taken from (`in_all_noise`); None where none were.
    """

    model: Model
    problem: Problem
    theta: Array
    noise: Noise
    residual: Array
    jacobian: Array
    all_noise: Noise | None = None

    @property
    def params(self) -> Parameters:
        """The estimates by key: `params["bias.x"].value`, `.std`, `.unit`, `.identified`."""
        return self.model.params

    def report(self) -> str:
        """The parameters with their uncertainties, and the error of each channel beside the noise floor."""
        unit, floor = self.problem.unit, "noise floor" if self.noise.known else "scatter (noise floor not known)"
        errors = [
            (name, quantity(self.rmse[c], unit), quantity(self.noise.floor[c], unit), f"{self.excess[c]:.2f}")
            for c, name in enumerate(self.channels)
        ]
        head = f"{self.model.name}, fitted to {self.table.n} rows of {self.table.source or 'data without a name'}"
        return f"{head}\n\n{self.params}\n\n{columns(('axis', 'rms error', floor, 'error / floor'), errors)}"

    def to_dict(self) -> dict[str, Any]:
        """`rig.fit/1`."""
        from calibrations.documents import fit_document
        from calibrations.loop import dataset

        return fit_document(dataset(self.table), self, None)

    def records(self) -> list[dict[str, Any]]:
        """A row a parameter."""
        return self.params.records()

    def plot(self) -> Figure:
        """The residual."""
        from calibrations.presentation.charts.fit import residual_chart
        from calibrations.presentation.static import draw

        return draw(residual_chart(self))

    def pictures(self) -> list[Picture]:
        """Measurement and model, the residual, and its pattern."""
        from calibrations.presentation.charts.fit import fit_album

        return fit_album(self)

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the parameters in the order of `params`, shape (p, p): its diagonal has the squares of `std`.

        NaN in the rows and columns of parameters that the data do not determine.
        """
        cautious = in_all_noise(self)
        matrix = covariance(cautious.information, self.problem.layout.typical)[0]
        wider = _wider(cautious)
        known = np.array([e.std is not None for e in self.params.values()])
        return np.where(np.outer(known, known), np.outer(wider, wider) * matrix, np.nan)

    @property
    def correlation(self) -> Array:
        """Correlation coefficients of the parameters in the order of `params`, shape (p, p), by the noise.

        NaN for parameters that the data do not determine. Uncertain inputs, such as the stages' angles, correlate
        parameters further; the certificate and the report include them.
        """
        std = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(std, std))

    def to_dataframe(self, of: str = "parameters") -> Any:
        """The parameters, or their "covariance" or "correlation" with names, as a pandas.DataFrame.

        Raises CalibrationError for another name, and where pandas is not installed.
        """
        if of == "parameters":
            return super().to_dataframe()
        matrices = {"covariance": lambda: self.covariance, "correlation": lambda: self.correlation}
        if of not in matrices:
            raise UnknownName(f'a fit has no data frame of "{of}"{nearest(of, ["parameters", *matrices])}')
        return data_frame(matrices[of](), index=list(self.params), columns=list(self.params))

    @property
    def table(self) -> Table:
        """The table, rows in order of time."""
        return self.problem.table

    @property
    def measured(self) -> Table:
        """The table, for provenance."""
        return self.table

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the residual's blocks."""
        return self.problem.channels

    @property
    def rmse(self) -> Array:
        """Root mean square of the residual per channel."""
        return rms(self.residual)

    @property
    def excess(self) -> Array:
        """Normalised rms residual per channel: rmse over noise floor."""
        return rms(self.residual) / self.noise.floor

    @property
    def pooled_excess(self) -> float:
        """The excess over all channels together."""
        return float(np.sqrt(np.mean(self.excess**2)))

    @cached_property
    def held_out_excess(self) -> float:
        """Pooled rms of the error on unseen rows over the noise floor."""
        return self.held_out_with(np.zeros((*self.residual.shape, 0)))

    def held_out_with(self, extra: Array) -> float:
        """The same when columns (channels, n, k) join the fit."""
        jacobian = np.concatenate([self.jacobian, extra], axis=2)
        theta = np.append(self.theta, np.zeros(extra.shape[2]))
        no_bound = np.full(extra.shape[2], np.inf)
        low, high = self.problem.layout.bounds
        bounds = np.append(low, -no_bound), np.append(high, no_bound)
        prior = np.append(self.problem.layout.prior, no_bound)
        return held_out(self.residual, jacobian, self.noise, folds(self.table), theta, prior, bounds)

    @cached_property
    def cross_validated_excess(self) -> float:
        """Excess by generalised cross-validation, in which no row weighs more than the others.

        The error on unseen rows is mostly that of the rows that alone determine a parameter, such as the few poses of
        a saturation. Source: Golub, Heath and Wahba, Technometrics 21 (1979) 215.
        """
        rows = self.residual.size
        parameters = parameters_of_rows(self.whitened[:, 1:], self.problem.layout.prior)
        return self.pooled_excess * rows / max(rows - parameters, 1.0)

    def share_left(self, start: Fit) -> float:
        """Part of the excess variance of `start` that this fit does not explain.

        Where it has priors by cross-validation, because a free form follows the rows of its fit; in motion, which has
        few rows, on unseen ones.
        """
        if self.table.type.moving:
            return max(self.held_out_excess**2 - 1, 0.0) / max(start.held_out_excess**2 - 1, 1e-9)
        if len(self.problem.layout.prior_rows):
            return max(self.cross_validated_excess**2 - 1, 0.0) / max(start.cross_validated_excess**2 - 1, 1e-9)
        return max(self.pooled_excess**2 - 1, 0.0) / max(start.pooled_excess**2 - 1, 1e-9)

    @property
    def residual_is_noise(self) -> bool:
        """Whether the residual itself is the only measure of noise: neither samples nor smooth columns give one."""
        return not self.noise.known and not self.problem.smooth.size

    def in_floor(self, floor: Array) -> Fit:
        """The fit with its errors in the floor (channels,) of another model, where its own is its residual.

        All models of a search share one floor; each would else be at a floor of its own, and no two comparable.
        """
        return replace(self, noise=replace(self.noise, reference=floor)) if self.residual_is_noise else self

    @cached_property
    def whitened(self) -> Array:
        """[residual, jacobian] made white, shape (channels * n, 1 + p)."""
        return self.noise.whiten(np.concatenate([self.residual[:, :, None], self.jacobian], axis=2))

    @property
    def information(self) -> Array:
        """Whitened jacobian, errors widened by the Birge ratio, and the priors below it, shape (rows, p)."""
        return np.vstack([self.whitened[:, 1:] / self.birge, self.problem.layout.prior_rows])

    @cached_property
    def birge(self) -> float:
        """Birge ratio: rms of the whitened residual, at least 1. Above 1, the model misses more than noise."""
        rows, p = self.residual.size, len(self.theta)
        return max(1.0, float(np.sqrt(np.sum(self.whitened[:, 0] ** 2) / max(rows - p, 1))))


LARGEST_CHANGE = 1e70  # of the output by a unit of a parameter: products of squares stay finite


def fit(model: Model, table: Table) -> Fit:
    """The model with parameters estimated from `table`. Raises TooFewRows, ModelError, DataError.

    Free forms of the model that have no sizes yet get them from the table.
    """
    if _requests(model):
        from calibrations.fitting.requested_forms import without_requested

        return refit(fit(without_requested(model), table), model)
    problem = Problem.of(model, table)
    return _alternate(
        problem, white_only(problem.white, problem.gap_s, len(problem.channels), problem.given), problem.layout.starts()
    )


def refit(before: Fit, model: Model, start: Array | None = None) -> Fit:
    """A changed model on the data of `before`; `start` for all its parameters.

    Raises ModelError where a free form of the model has no sizes yet, and the data cannot show them.
    """
    if _requests(model):
        from calibrations.fitting.requested_forms import with_sizes

        model = with_sizes(model, before)
    problem = Problem.of(model, before.table)
    return _alternate(problem, in_white_noise(before).noise, problem.layout.starts() if start is None else [start])


def in_white_noise(before: Fit) -> Fit:
    """The fit in the white noise of its rows, where that is known.

    Its slow noise contains what the next effect explains. And a fit that begins in white noise depends on the model
    and the data alone, not on the fits before it.
    """
    problem = before.problem
    if problem.white is None:
        return before
    return replace(before, noise=white_only(problem.white, problem.gap_s, len(problem.channels), problem.given))


def _alternate(problem: Problem, noise: Noise, starts: list[Array]) -> Fit:
    """Parameters and noise in turn. Raises ModelError for an effect with values that no fit resolves."""
    with np.errstate(over="ignore", invalid="ignore"):  # what follows from them is refused
        try:
            found = _alternate_unchecked(problem, noise, starts)
        except np.linalg.LinAlgError:
            raise _unresolved_error(problem, starts[0]) from None
        if not (np.abs(found.jacobian) < LARGEST_CHANGE).all():
            raise _unresolved_error(problem, starts[0])
    return found


def _unresolved_error(problem: Problem, theta: Array) -> ModelError:
    """Names the parameter that changes the output most."""
    sizes = np.abs(problem.jacobian(theta)).max(axis=(0, 1))
    slot = problem.layout.slots[int(np.argmax(sizes))]  # a size that is no number is the largest
    return ModelError(
        f"{problem.layout.model.terms[slot.term].name}: the parameter {slot.parameter.name} changes the output by more "
        "than a fit can resolve; give an effect with smaller values, without nested exp and without huge factors"
    )


def _alternate_unchecked(problem: Problem, noise: Noise, starts: list[Array]) -> Fit:
    """As `_alternate`; raises LinAlgError."""
    theta = min((minimise(problem, noise, start) for start in starts), key=lambda t: t[1])[0]
    # with smooth columns set aside the noise hardly depends on the parameters, and one round is enough
    for _ in range(1 if problem.smooth.size else ROUNDS):
        estimated = estimate(noise, problem.residual(theta), _free(problem, problem.jacobian(theta)), problem.smooth)
        if estimated.is_like(noise):
            break
        noise = estimated
        theta, _ = minimise(problem, noise, theta)
    return _result(problem, theta, noise)


def evaluate(model: Model, table: Table) -> Fit | None:
    """The model with the values that it has, on `table`; None where it has none."""
    if _requests(model):
        return None
    problem = Problem.of(model, table)
    theta = problem.layout.known()
    if theta is None:
        return None
    residual, jacobian = problem.residual(theta), problem.jacobian(theta)
    noise = white_only(problem.white, problem.gap_s, len(problem.channels), problem.given)
    noise = estimate(noise, residual, _free(problem, jacobian), problem.smooth)
    return Fit(replace(model, unit=table.unit), problem, theta, noise, residual, jacobian)


def _requests(model: Model) -> bool:
    """Whether a free form of the model has no sizes yet. Few models have a free form, and its modules load slowly."""
    if not any(term.name.startswith(PREFIX) for term in model.terms):
        return False
    from calibrations.fitting.requested_forms import find_requested

    return bool(find_requested(model))


def _free(problem: Problem, jacobian: Array) -> Array:
    """Columns of the parameters without a prior: a prior already keeps the others from following noise."""
    return jacobian[:, :, ~np.isfinite(problem.layout.prior)]


def _result(problem: Problem, theta: Array, noise: Noise) -> Fit:
    residual, jacobian = problem.residual(theta), problem.jacobian(theta)
    model = replace(problem.layout.model, unit=problem.table.unit)
    return _with_uncertainties(Fit(model, problem, theta, noise, residual, jacobian))


def _with_uncertainties(result: Fit) -> Fit:
    cautious = in_all_noise(result)
    model = estimates(result.model, result.problem.layout, result.theta, cautious.information, _wider(cautious))
    return replace(result, model=model, all_noise=cautious.noise)


def with_least_white(result: Fit, white: Array) -> Fit:
    """The fit with standard uncertainties that allow for slow noise above a smaller `white` (channels, n).

    White noise that was raised to the size of the residual contains slow noise, which makes parameters less certain.
    """
    noise = replace(result.noise, white=np.minimum(white, result.noise.white), scatter=0 * result.noise.scatter)
    uncertain = _with_uncertainties(replace(result, noise=noise, all_noise=None))
    return replace(uncertain, noise=result.noise)


def _wider(cautious: Fit) -> Array:
    """Factors on the standard uncertainties."""
    by_noise = _wider_by_noise(cautious)
    if not any(term.name.startswith(PREFIX) for term in cautious.model.terms):
        return by_noise
    from calibrations.fitting.time_curves import widen_by_curves  # few models have a free form

    return by_noise * widen_by_curves(cautious, by_noise)


def _wider_by_noise(cautious: Fit) -> Array:
    """Factors by the slow noise that the rows allow, or by their number."""
    if not cautious.problem.averages:
        return _student_factors(cautious)
    layout = cautious.problem.layout
    wider, free = np.ones(len(cautious.theta)), ~np.isfinite(layout.prior)
    jacobian = _free(cautious.problem, cautious.jacobian)
    problem, typical = cautious.problem, layout.typical[free]
    if problem.table.type.magnitude:
        from calibrations.fitting.slow_outputs import widen_by_magnitudes  # positions alone need it

        axes = problem.table.outputs.shape[1]
        identity = np.broadcast_to(np.eye(axes), (problem.table.n, axes, axes))
        by_output = problem.of_output(cautious.theta, identity)
        wider[free] = widen_by_magnitudes(cautious.noise, cautious.residual, jacobian, by_output, typical)
    else:
        wider[free] = widening(cautious.noise, cautious.residual, jacobian, typical)
    return wider


def _student_factors(fit: Fit) -> Array:
    """Factors on the standard uncertainties: what Student's t spreads beyond a normal distribution.

    Each parameter has the degrees of freedom of its channels' noise, weighted by what each channel tells of it.
    """
    if fit.noise.given:
        return np.ones(len(fit.theta))
    informed = np.sum(fit.whitened[:, 1:].reshape(*fit.residual.shape, -1) ** 2, axis=1)
    total = informed.sum(axis=0)
    rows = np.where(
        total > 0, fit.noise.effective_rows @ informed / np.where(total > 0, total, 1.0), fit.residual.shape[1]
    )
    freedom = np.maximum(rows - 1, LEAST_FREEDOM)
    return np.asarray(np.sqrt(freedom / (freedom - 2)))


def in_all_noise(result: Fit) -> Fit:
    """The fit under all the noise that its residual shows, from which standard uncertainties are taken.

    Here nothing is set aside: where inclinations follow each other in time, smooth functions of the angles take up slow
    noise as well, and parameters would look more certain than they are.
    """
    if result.all_noise is not None:
        return replace(result, noise=result.all_noise)
    jacobian = _free(result.problem, result.jacobian)
    noise = estimate(result.noise, result.residual, jacobian, np.zeros((result.table.n, 0)))
    return replace(result, noise=noise.prolonged())
