"""What the data determine: whether a model at all, and which effects they could show.

With leverages h (the diagonal of the hat matrix of the whitened jacobian), the error on an unseen row has a variance
1 / (1 - h) times that of noise. Where it is more than twice on average, the uncertainty of the parameters counts for
more than all noise, and a small residual proves nothing. A leverage of 1 differs: one row alone determines a parameter,
and nothing checks it.

An effect can be tested where at least one of its parameters would be known better than the typical value of a sensor
(`identifiability`), fitted jointly with the model. One inclination, or a turn one way only, hides several effects.

Source  leave-one-out prediction variance of linear least squares; Hoaglin and Welsch (1978), the hat matrix.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from calibrations.criteria import MOST_UNCERTAIN
from calibrations.effects import Effect
from calibrations.fitting.fit import Fit
from calibrations.fitting.identifiability import UNDETERMINED, covariance
from calibrations.fitting.problem_kinds import make_problem
from calibrations.geometry.sphere import magnetometer_coverage_warning
from calibrations.means.noise import rms
from calibrations.model.parameters import Layout
from calibrations.table import Array

ROUNDING = 1e-9  # of a leverage
LEAST_SPREAD = 0.1  # of that of another model: positions then have one orientation


def leverages(fit: Fit) -> Array:
    """The diagonal of the hat matrix, shape (channels, n): 1 where one value alone determines a parameter."""
    jacobian = np.vstack([fit.whitened[:, 1:], fit.problem.layout.prior_rows])
    size = np.linalg.norm(jacobian, axis=0)
    columns = jacobian[:, size > 0] / size[size > 0]
    basis, singular, _ = np.linalg.svd(columns, full_matrices=False)
    spanned = basis[:, singular > 1e-8 * singular[0]] if singular.size else basis[:, :0]
    return np.asarray(np.sum(spanned**2, axis=1))[: fit.residual.size].reshape(fit.residual.shape)


def unseen_variance(leverage: Array) -> float:
    """Mean variance of the error on an unseen row over that of noise; 1 where parameters are known exactly."""
    return float(np.mean(1 / np.maximum(1 - leverage, 1e-12)))


def explain_undetermined(fit: Fit) -> str | None:
    """Why a small residual proves nothing on this data, in words; None if the data determine the model."""
    if reason := magnetometer_coverage_warning(fit.table):
        return reason
    leverage = leverages(fit)
    variance, lone = unseen_variance(leverage), leverage > 1 - ROUNDING
    if variance <= MOST_UNCERTAIN:
        return None
    if lone.any() and not lone.all() and unseen_variance(leverage[~lone]) <= MOST_UNCERTAIN:
        return _warn_of_unchecked_rows(fit, lone)
    rows = "positions" if fit.table.type.magnitude else "rows"
    times = f"{np.sqrt(variance):.1f}" if variance < 1e4 else "many"
    prediction = f"the prediction of another one is {times} times less certain than one measurement"
    if all(estimate.identified for estimate in fit.params.values()):
        return (
            f"the {fit.table.n} {rows} determine the {len(fit.theta)} parameters and cannot check them: {prediction}; "
            "measure at more orientations to check the model"
        )
    return (
        f"the {len(fit.theta)} parameters are not identifiable from {fit.table.n} {rows}: {prediction}; "
        "measure at more orientations"
    )


def _warn_of_unchecked_rows(fit: Fit, lone: NDArray[np.bool_]) -> str:
    """Warn that some rows, `lone` in shape (channels, n), determine a parameter alone."""
    rows = np.flatnonzero(lone.any(axis=0))
    paths = fit.table.labels.get("path")
    labels = [paths[k] for k in rows] if paths else [f"row {number}" for number in fit.table.numbered(rows)]
    return (
        f"the fit cannot check all of the {len(fit.theta)} parameters: {lone.sum()} of the {lone.size} measured "
        "values "
        f"({', '.join(labels)}) each determine one parameter alone; repeat these measurements"
    )


def loses_parameters(smaller: Fit, larger: Fit) -> bool:
    """Whether a parameter that `smaller` determines is undetermined in `larger`: for positions of unknown orientation.

    With enough nonlinearity, or with a far too large scale factor, a model can give every output the same magnitude;
    the parameters then mean nothing.
    """
    if not larger.table.type.magnitude:
        return False
    if _spread_of_sensed(larger) < LEAST_SPREAD * _spread_of_sensed(smaller):
        return True
    identified = {key for key, e in smaller.params.items() if e.identified}
    return any(key in identified and not e.identified for key, e in larger.params.items())


def _spread_of_sensed(fit: Fit) -> float:
    """Rms of the sensed quantity about its mean, by the model."""
    return float(rms(np.std(fit.problem.sensed(fit.theta), axis=0)))


def blind_to(fit: Fit, effects: Mapping[str, Effect]) -> tuple[str, ...]:
    """The effects, of the model or not, that this table has the columns for and whose parameters it leaves unknown."""
    return tuple(name for name, effect in effects.items() if _cannot_be_shown(fit, effect))


def _cannot_be_shown(fit: Fit, effect: Effect) -> bool:
    if effect.incidental:
        return False
    if fit.table.content in effect.kinds and effect.lacks(fit.table) is not None:
        return True
    return _has_enough_data(fit, effect) and not _is_determined(fit, effect)


def _has_enough_data(fit: Fit, effect: Effect) -> bool:
    """Whether there is a column for all that it needs, and a row for each parameter."""
    if effect.excluded(fit.table) is not None:
        return False
    return fit.residual.size > len(Layout.of(fit.model.with_effect(effect), fit.table).slots)


def _is_determined(fit: Fit, effect: Effect) -> bool:
    """Whether a parameter of the effect is determined, from any of its starts."""
    model = fit.model if fit.model.holds(effect.name) else fit.model.with_effect(effect)
    problem = make_problem(model, fit.table)
    own_columns, typical = problem.layout.of_effect(effect.name), problem.layout.typical
    starts = [fit.theta] if model is fit.model else problem.layout.starts()
    return any(_determined(fit, problem.jacobian(theta), own_columns, typical) for theta in starts)


def _determined(fit: Fit, jacobian: Array, own_columns: NDArray[np.bool_], typical: Array) -> bool:
    if not np.any(jacobian[:, :, own_columns]):
        return False
    cov, null = covariance(fit.noise.whiten(jacobian), typical)
    std, free = np.sqrt(np.diag(cov)), np.sum(null**2, axis=0)
    return bool(np.any((free[own_columns] <= UNDETERMINED) & (std[own_columns] < typical[own_columns])))
