"""Separation of two explanations in planned data (T-optimality), and the expected table of planned poses.

    lambda = min over theta of |W (f_best - f_rival(theta))|^2        W makes the noise white

It is the noncentrality of the test between them. Where the best is right, twice the logarithm of the likelihood ratio
scatters about lambda with the standard deviation 2 sqrt(lambda); sqrt(lambda) is their distance in standard deviations.

Source  Atkinson and Fedorov, Biometrika 62 (1975), 57-70; Dette, Melas and Guchenko, Annals of Statistics 43 (2015),
        1959-1985.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from calibrations.criteria import CERTAIN_PROBABILITY, INSEPARABLE, NAMED_GAIN
from calibrations.design.optimal_design import noise_on_rows
from calibrations.errors import DataError, MissingColumn
from calibrations.fitting.fit import Fit
from calibrations.fitting.minimise import newton_step
from calibrations.fitting.problem_kinds import make_problem
from calibrations.geometry.orientation import reported_force
from calibrations.joined import join_tables
from calibrations.means.noise import white_only
from calibrations.model import Model
from calibrations.model.chain import forward
from calibrations.model.parameters import Layout
from calibrations.table import AXES, Array, Constant, Table

ROUNDS, CLOSE_GAIN = 12, 1e-2  # steps, and the change of lambda, relative or at least absolute, at which they end


@dataclass(frozen=True)
class ExpectedResult:
    """The expected result of an experiment: lambda of its own data, and of all data together.

    `visible` is lambda of its own data between an explanation and nothing missing: what does not show is not named.
    """

    alone: float
    together: float
    visible: float = np.inf

    @property
    def deviations(self) -> float:
        """Expected distance of the explanations in standard deviations, from all data together."""
        return float(np.sqrt(self.together))

    @property
    def probability(self) -> float:
        """Probability that all data together separate them."""
        return pairs_separated(self.together)

    @property
    def probability_alone(self) -> float:
        """Probability that its own data alone show the missing effect."""
        return min(pairs_separated(self.alone), _exceedance(self.visible, NAMED_GAIN))

    @property
    def suffices_alone(self) -> bool:
        """Whether its own data are enough to find the missing effect."""
        return self.probability_alone >= CERTAIN_PROBABILITY

    @property
    def decisive(self) -> float:
        """Lambda of the data that decide: its own data if they are enough, else all data together."""
        return self.alone if self.suffices_alone else self.together

    @property
    def percent(self) -> str:
        """The probability that these data separate the explanations, as text."""
        return f"{min(100 * pairs_separated(self.decisive), 99.9):.3g} %"


def expected_gain(best: Fit, rival: Fit, table: Table) -> ExpectedResult:
    """The expected separation of two explanations of the present data by the predicted `table`.

    Both are fits to the same data. Of the two cases, the best right and the rival right, the worse one counts. Times
    of `table` come after those of the data.
    """
    variations = [vary_one_way(best, rival, table), vary_one_way(rival, best, table)]
    return ExpectedResult(min(w.alone for w in variations), min(w.together for w in variations))


def pairs_separated(noncentrality: float) -> float:
    """Probability that the likelihood ratio exceeds the odds that separate two explanations."""
    return _exceedance(noncentrality, INSEPARABLE)


def _exceedance(noncentrality: float, threshold: float) -> float:
    """Probability that a statistic of mean lambda and standard deviation 2 sqrt(lambda) is beyond a threshold."""
    if noncentrality <= 0 or noncentrality == np.inf:
        return float(noncentrality > 0)
    return float(ndtr((noncentrality - threshold) / (2 * np.sqrt(noncentrality))))


def vary_one_way(right: Fit, wrong: Fit, table: Table) -> ExpectedResult:
    """The expected result if `right` is the true model: the noise is that of `right`."""
    least = _distance(right, wrong, table)
    return ExpectedResult(least(False), least(True))


def distance_alone(right: Fit, wrong: Fit, table: Table) -> float:
    """Lambda of the new data alone, where `right` is."""
    return _distance(right, wrong, table)(False)


def _distance(right: Fit, wrong: Fit, table: Table) -> Callable[[bool], float]:
    """Lambda of the new data, as a function of whether the present data count as well.

    Predictions come from both fits' own history.
    """
    all_data = join_tables([right.table, table])
    is_present = np.arange(all_data.n) < right.table.n
    truth = right.problem.on(all_data).residual(right.theta)
    mistaken = wrong.problem.on(all_data)
    noise = noise_on_rows(right.noise, right.problem.on(table))

    errors, slopes = mistaken.residual(wrong.theta) - truth, mistaken.jacobian(wrong.theta)

    def least(with_present: bool) -> float:
        def white(columns: Array) -> Array:
            """(channels, n, k) -> (rows, k)."""
            new = noise.whiten(columns[:, ~is_present])
            return np.concatenate([right.noise.whiten(columns[:, is_present]), new]) if with_present else new

        def distance(theta: Array) -> Array:
            return white((mistaken.residual(theta) - truth)[:, :, None])[:, 0]

        theta, residual, slope = wrong.theta, white(errors[:, :, None])[:, 0], white(slopes)
        for _ in range(ROUNDS):
            square_before = float(residual @ residual)
            theta, residual = newton_step(mistaken.layout, distance, theta, residual, slope)
            if square_before - float(residual @ residual) < CLOSE_GAIN * max(float(residual @ residual), 1.0):
                break
            slope = white(mistaken.jacobian(theta))
        return float(residual @ residual)

    return least


# A model that counts as true before there are data: a plan is made for it.
#
# The values are those of the model, otherwise the typical ones of a sensor. The noise is white, that of Ang's sensor.
# For effects that are linear in the output neither changes the best poses; for others (a dead zone, hysteresis) the
# best poses are those for these values (local optimality: Chernoff, 1953).

SAMPLE_STD_V = 3.1e-3 / 4  # Ang V: peak to peak is four times rms
CALM_SPREAD = {
    "reference_c": ("temperature_c", 25.0),
    "reference_v": ("supply_v", 5.0),
}  # constants of effects; held there


def assume_sensor(
    model: Model, columns: Mapping[str, Array], constants: Mapping[str, Constant], axes: Sequence[str] = AXES[:2]
) -> Fit:
    """`model` as fitted to the poses of `columns` (alpha_deg, beta_deg, ..., each of shape (n,)).

    Its residual is 0. Temperature and supply do not change. Raises ModelError and TooFewRows as a fit does.
    """
    table = _expect_outputs(model, columns, constants, axes)
    problem = make_problem(model, table)
    theta = _values(problem.layout)
    noise = white_only(problem.white, problem.gap_s, len(problem.channels))
    zero_residual = np.zeros((len(problem.channels), table.n))
    return Fit(problem, theta, noise, zero_residual, problem.jacobian(theta), problem.layout.model)


def _expect_outputs(
    model: Model, columns: Mapping[str, Array], constants: Mapping[str, Constant], axes: Sequence[str]
) -> Table:
    """A table of the poses, with outputs of 1 V/g."""
    n = len(columns["alpha_deg"])
    references = {name: value for term in model.terms for name, value in term.constants.items()}
    calm = {column: np.full(n, references.get(name, usual)) for name, (column, usual) in CALM_SPREAD.items()}
    noise = {f"v{axis}_std_v": np.full(n, SAMPLE_STD_V) for axis in axes}
    flat = {f"v{axis}_v": np.zeros(n) for axis in axes}
    table = Table.from_columns("poses", {"n": np.ones(n)} | calm | dict(columns) | noise | flat, constants, "a plan")
    a = reported_force(table)
    outputs = {f"v{axis}_v": a[:, AXES.index(axis)] for axis in axes}
    return Table.from_columns("poses", {**table.columns, **outputs}, constants, "a plan")


def _values(layout: Layout) -> Array:
    """The model's values; for a parameter without one its start, or its typical size where the start is 0."""
    start = layout.starts()[0]
    free = layout.known() is None
    unset = [free and (s.term, s.parameter.name, s.axis) not in layout.from_data for s in layout.slots]
    return np.where((start == 0) & unset, layout.typical, start)


# The expected table of planned poses: a design of experiments is judged on it.
#
# The outputs are those of the fitted model, without noise. As in each table, the noise is given by the standard
# deviation of single samples and by their number, both from the data of the fit, so a longer dwell has less noise.

PLAN_COLUMNS = ("t_s", "direction")  # a plan's own: the mean of other data does not replace them


def predict_data(template: Fit, columns: Mapping[str, Array]) -> Table:
    """The expected table of the sensor of the fit `template` for planned `columns`.

    `columns`, each of shape (n,): alpha_deg and beta_deg; optionally direction, flip, mount_deg, t_s,
    temperature_c, ...; `n` samples a mean, or `dwell_s` at the data's sample rate, else as many as the data's. Columns
    that the model's effects need and a plan does not set, such as temperature_c, are held at their mean in the data.
    Constants (filter corner, gravity, approach) are the data's.

    Raises DataError for a fit to another kind of table, and for `dwell_s` where no sample rate is known; MissingColumn
    for a time or a direction that the model needs.
    """
    data = template.table
    if not data.type.stage_angles:
        raise DataError(f"{data.source}: a fit to {data.kind} cannot predict poses; fit the model to poses")
    names = data.output_names
    planned = {name: np.asarray(values, dtype=np.float64) for name, values in columns.items() if name != "dwell_s"}
    rows = len(planned["alpha_deg"])
    constant = {
        name: np.full(rows, np.mean(data.column(name))) for name in _unplanned_columns(template) if name not in planned
    }
    values = constant | _noise(template, columns, rows) | planned | {name: np.zeros(rows) for name in names}
    table = Table.from_columns("poses", values, data.constants, f"a plan like {data.source}")
    _check_planned(template, table)
    outputs = forward(table, template.problem.layout.steps(template.theta))
    return replace(table, columns={**table.columns, **dict(zip(names, outputs.T, strict=True))})


def _unplanned_columns(template: Fit) -> set[str]:
    """Columns that the effects of the model need and that a plan does not have."""
    return {name for term in template.model.terms for name in term.effect.needs} - set(PLAN_COLUMNS)


def _check_planned(template: Fit, table: Table) -> None:
    for term in template.model.terms:
        if reason := term.effect.excluded(table):
            raise MissingColumn(f"{table.source}: {term.name} {reason}; plan it")


def _noise(template: Fit, columns: Mapping[str, Array], rows: int) -> dict[str, Array]:
    """Standard deviation of samples, and the number of samples of a mean; empty if the data has none."""
    data = template.table
    usual = {name: float(np.median(data.column(name))) for name in data.std_names if name in data}
    if "n" in data and "n" not in columns:
        usual["n"] = float(np.median(data.column("n")))
    noise = {name: np.full(rows, value) for name, value in usual.items()}
    if "dwell_s" not in columns:
        return noise
    rate_hz = data.number("sample_rate_hz", 0.0)
    if not rate_hz:
        raise DataError(f"{data.source}: the sample rate is unknown; plan `n`, or give `# sample_rate_hz: 1000`")
    return noise | {"n": np.maximum(np.round(np.asarray(columns["dwell_s"]) * rate_hz), 1.0)}
