"""Joint least-squares estimate of a model's parameters, with uncertainties that allow for slow noise.

Parameters and noise are estimated in turn: least squares under the present noise, then the noise of greatest
likelihood given the residual, until neither moves. Where the model does not describe the data, its parameters are less
certain than the noise alone makes them: standard uncertainties are widened by the Birge ratio.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from calibrations.errors import ModelError, UnknownName, nearest
from calibrations.fitting.identifiability import correlation_matrix, covariance, with_estimates
from calibrations.fitting.minimise import minimise
from calibrations.fitting.noise_fit import estimate
from calibrations.fitting.problem import Problem
from calibrations.fitting.problem_kinds import make_problem
from calibrations.fitting.solution import Solution, solution_at, white_noise
from calibrations.fitting.uncertainty import estimate_all_noise, uncertainty_factors
from calibrations.frames import data_frame
from calibrations.free_forms.place_names import PREFIX
from calibrations.geometry.orientation import one_orientation
from calibrations.means.noise import Noise
from calibrations.model import Model
from calibrations.model.model import Parameters
from calibrations.result import Result
from calibrations.table import MILLI, Array, Table

ROUNDS = 2
LARGEST_CHANGE = 1e70  # of the output by a unit of a parameter: products of squares stay finite


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Solution, Result):
    """A model fitted to a table.

    `all_noise`: the noise of the standard uncertainties (`in_all_noise`); None if the model has values from elsewhere.
    """

    model: Model
    all_noise: Noise | None = None

    @property
    def params(self) -> Parameters:
        """The estimates by key: `params["bias.x"].value`, `.std`, `.unit`, `.identified`."""
        return self.model.params

    def records(self) -> list[dict[str, Any]]:
        """A row a parameter."""
        return self.params.records()

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the parameters in the order of `params`, shape (p, p): its diagonal has the squares of `std`.

        NaN in the rows and columns of parameters that the data do not determine.
        """
        cautious = self.in_all_noise()
        matrix = covariance(cautious.information, self.problem.layout.typical)[0]
        wider = uncertainty_factors(cautious)
        known = np.array([e.std is not None for e in self.params.values()])
        return np.where(np.outer(known, known), np.outer(wider, wider) * matrix, np.nan)

    @property
    def correlation(self) -> Array:
        """Correlation coefficients of the parameters in the order of `params`, shape (p, p), by the noise.

        NaN for parameters that the data do not determine. Uncertain inputs, such as the stages' angles, correlate
        parameters further; the certificate and the report include them.
        """
        return correlation_matrix(self.covariance)

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
    def measured(self) -> Table:
        """The table, for provenance."""
        return self.table

    def in_all_noise(self) -> Fit:
        """The fit in all the noise that its residual shows, from which standard uncertainties are computed."""
        return replace(self, noise=estimate_all_noise(self) if self.all_noise is None else self.all_noise)


def fit(model: Model, table: Table) -> Fit:
    """The model with parameters estimated from `table`. Raises TooFewRows, ModelError, DataError.

    Free forms of the model that have no sizes yet get them from the table.
    """
    if _requests(model):
        from calibrations.fitting.requested_forms import without_requested

        return refit(fit(without_requested(model), table), model)
    problem = make_problem(model, table)
    return _alternate(problem, white_noise(problem), problem.layout.starts())


def refit(before: Fit, model: Model, start: Array | None = None) -> Fit:
    """A changed model on the data of `before`; `start` for all its parameters.

    Raises ModelError where a free form of the model has no sizes yet, and the data cannot show them.
    """
    if _requests(model):
        from calibrations.fitting.requested_forms import with_sizes

        model = with_sizes(model, before)
    problem = make_problem(model, before.table)
    # a start may be a linear step away from values that have bounds
    starts = problem.layout.starts() if start is None else [np.clip(start, *problem.layout.bounds)]
    return _alternate(problem, before.in_white_noise().noise, starts)


def _alternate(problem: Problem, noise: Noise, starts: list[Array]) -> Fit:
    """Parameters and noise in turn. Raises ModelError for an effect with values that no fit resolves."""
    with np.errstate(over="ignore", invalid="ignore"):  # a fit with such values is refused below
        try:
            fitted = _alternate_unchecked(problem, noise, starts)
        except np.linalg.LinAlgError:
            raise _unresolved_error(problem, starts[0]) from None
        if not (np.abs(fitted.jacobian) < LARGEST_CHANGE).all():
            raise _unresolved_error(problem, starts[0])
    return fitted


def _unresolved_error(problem: Problem, theta: Array) -> ModelError:
    """Names the parameter that changes the output most."""
    sizes = np.abs(problem.jacobian(theta)).max(axis=(0, 1))
    slot = problem.layout.slots[int(np.argmax(sizes))]  # argmax takes a NaN for the largest
    return ModelError(
        f"{problem.layout.model.terms[slot.term].name}: the parameter {slot.parameter.name} changes the output by more "
        "than a fit can resolve; give an effect with smaller values, without nested exp and without huge factors"
    )


def _alternate_unchecked(problem: Problem, noise: Noise, starts: list[Array]) -> Fit:
    """Do the work of `_alternate`; raises LinAlgError."""
    theta = min((minimise(problem, noise, start) for start in starts), key=lambda t: t[1])[0]
    # with smooth columns set aside the noise hardly depends on the parameters, and one round is enough
    for _ in range(1 if problem.smooth.size else ROUNDS):
        estimated = _estimate_noise(solution_at(problem, theta, noise))
        if estimated.is_like(noise):
            break
        noise = estimated
        theta, _ = minimise(problem, noise, theta)
    model = replace(problem.layout.model, unit=problem.table.unit)
    return _with_uncertainties(_make_fit(solution_at(problem, theta, noise), model))


def evaluate(model: Model, table: Table) -> Fit | None:
    """The model with the values that it has, on `table`; None where it has none."""
    if _requests(model):
        return None
    problem = make_problem(model, table)
    theta = problem.layout.known()
    if theta is None:
        return None
    solution = solution_at(problem, theta, white_noise(problem))
    return _make_fit(replace(solution, noise=_estimate_noise(solution)), replace(model, unit=table.unit))


def _estimate_noise(solution: Solution) -> Noise:
    """The noise of greatest likelihood given the residual."""
    return estimate(solution.noise, solution.residual, solution.free_jacobian, solution.problem.smooth)


def _make_fit(s: Solution, model: Model) -> Fit:
    return Fit(s.problem, s.theta, s.noise, s.residual, s.jacobian, model)


def _requests(model: Model) -> bool:
    """Whether a free form of the model has no sizes yet. Few models have a free form, and its modules load slowly."""
    if not any(term.name.startswith(PREFIX) for term in model.terms):
        return False
    from calibrations.fitting.requested_forms import find_requested

    return bool(find_requested(model))


def _with_uncertainties(result: Fit) -> Fit:
    """The fit with the values and standard uncertainties of its parameters in its model."""
    cautious = result.in_all_noise()
    factors = uncertainty_factors(cautious)
    model = with_estimates(result.model, result.problem.layout, result.theta, cautious.information, factors)
    return replace(result, model=model, all_noise=cautious.noise)


def with_least_white(result: Fit, white: Array) -> Fit:
    """The fit with standard uncertainties that allow for slow noise above a smaller `white` (channels, n).

    White noise that was raised to the size of the residual contains slow noise, which makes parameters less certain.
    """
    noise = replace(result.noise, white=np.minimum(white, result.noise.white), scatter=0 * result.noise.scatter)
    uncertain = _with_uncertainties(replace(result, noise=noise, all_noise=None))
    return replace(uncertain, noise=result.noise)


# Residuals in the unit of the sensed quantity: mg, thousandths of the field, or mdeg/s. At one orientation the scale
# factor is not known: there they are in mV.


def scales(fitted: Fit) -> Array:
    """Output per g, or deg/s, of each channel; 1 if the residual is in the unit of the input, or if it is not known."""
    if fitted.table.type.from_output:
        return np.ones(len(fitted.channels))
    if one_orientation(fitted.table):
        return np.ones(len(fitted.channels))
    effect = "gyro-scale-factor" if fitted.table.type.turning else "scale-factor"
    axes, nominal = [axis_of(channel) for channel in fitted.channels], fitted.problem.layout.nominal
    return np.abs([fitted.model.value(f"{effect}.{axis}", nominal) for axis in axes])


def axis_of(channel: str) -> str:
    """The axis that a channel belongs to: "x" of "x in phase at 10 Hz"; itself where it has no parts."""
    return channel.partition(" ")[0]


def milli_unit(fitted: Fit) -> str:
    """The unit of `in_milli`."""
    return f"m{fitted.problem.unit}" if one_orientation(fitted.table) else MILLI[fitted.table.input_unit]


def in_milli(values: Array, fitted: Fit) -> Array:
    """Values per channel, in the residual's unit, as mg, thousandths of the field, or mdeg/s."""
    return np.asarray(1e3 * values / scales(fitted))


def pool_in_milli(fitted: Fit) -> tuple[float, float]:
    """Rms of the residual over all channels, and the noise floor, in the unit of `in_milli`."""
    error, floor = in_milli(fitted.rmse, fitted), in_milli(fitted.noise.floor, fitted)
    return float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(floor**2)))
