"""A certificate as headings, facts and tables: one text for HTML and PDF."""

from __future__ import annotations

import math
from collections.abc import Iterator

from calibrations.presentation.budget import SOURCE_HEAD
from calibrations.presentation.certificate.content import RULE, Certificate, Decision, Outcome
from calibrations.presentation.certificate.results import CONSERVATIVE, WIDENED
from calibrations.presentation.document import Facts, Section, Table
from calibrations.text import expand_uncertainty, freedom_text, minus, rounded, unit, value_text

END_SCATTER = 2.67  # of a normal's 97.5 % quantile, in its standard deviation, times the root of the trials
WIDE = 10  # columns of a correlation matrix side by side
HEAVIEST = 3  # poses with the largest weight, given with a result
METHOD = (
    "Terms and symbols as in IEEE Std 1293 (linear single-axis accelerometers) and IEEE Std 2700 (performance "
    "parameters of sensors). The parameters are estimated jointly, by least squares under the noise that the data "
    "show."
)
EXPANSION_TEXT = (
    "As left. U is the expanded uncertainty for a coverage probability of about 95 %: k = 2, or Student's factor "
    "for the effective degrees of freedom, cut to a whole number, if that is larger. Widened: k is increased so that U "
    "reaches the interval of the check by simulation. g is the local gravity."
)
BUDGET = (
    "After the GUM (JCGM 100). Type A: the noise of the data. Type B: the stated uncertainties of inputs that the data "
    "cannot show. Effective degrees of freedom by Welch and Satterthwaite."
)
CORRELATION_TEXT = (
    "Results from the same data are correlated. A quantity computed from several of them requires their correlation "
    "coefficients (GUM 5.2.2)."
)
TRIALS = (
    "The budget is compared with the propagation of distributions (GUM Supplement 1, JCGM 101) with {trials} trials. "
    "Confirmed: both ends of the intervals agree within half a unit of u's first digit. Conservative: the interval of "
    "the budget is wider, because u includes the uncertainty of slow noise, and k the number of degrees of freedom; "
    "the simulation includes neither. Widened: the simulated interval is wider, and U is increased to it. The ends of "
    "simulated intervals have a random error of {scatter:.2f} u."
)
ROWS = (
    "All results follow from the rows below. Each row is the mean of a block of samples in the record. The digest is "
    "the beginning of the SHA-256 of these samples; the machine-readable certificate has the whole digest and the "
    "weight of every row in every result."
)
NO_LIMITS = "No limits were given, so there is no statement of conformity."
STATEMENTS = {
    "pass": "pass",
    "conditionalPass": "conditional pass",
    "conditionalFail": "conditional fail",
    "fail": "fail",
}


def sections(c: Certificate) -> list[Section]:
    """All sections of the certificate, in order."""
    return [
        _identification(c),
        _procedure(c),
        _environment(c),
        _results(c),
        _as_found_section(c),
        _uncertainty(c),
        _traceability(c),
    ]


def verdict(c: Certificate) -> str:
    """The worst statement of conformity; nothing where no result has a limit."""
    statements = {o.decision.statement for o in c.figures.outcomes if o.decision is not None}
    return next((text for key, text in reversed(STATEMENTS.items()) if key in statements), "")


def _identification(c: Certificate) -> Section:
    lab = c.laboratory
    place = ", ".join(filter(None, (lab.street, f"{lab.post_code} {lab.city}".strip(), lab.country)))
    head = ("role", "instrument", "serial number", "firmware", "certificate", "due")
    rows = tuple(
        (i.role, i.model, i.serial or "–", i.firmware or "–", i.certificate or "none given",
         f"{i.due or '–'}{', expired' if i.expired else ''}")
        for i in c.instruments
    )  # fmt: skip
    facts = (
        ("laboratory", f"{lab.name}, {place}"),
        ("responsible", f"{lab.person}, {lab.role}"),
        ("customer", c.customer),
        ("sensor", c.sensor),
        ("serial number", c.serial),
        ("manufacturer", c.manufacturer),
        ("rig", c.rig),
    )
    tables = (Table("Instruments and their certificates", head, rows),) if rows else ()
    return Section("Identification", (Facts(facts), *tables))


def _procedure(c: Certificate) -> Section:
    facts = (
        ("procedure", c.procedure),
        ("begun", c.began),
        ("ended", c.ended),
        ("model", c.figures.model),
        *c.facts.items(),
    )
    return Section("Procedure", (METHOD, Facts(facts)))


def _environment(c: Certificate) -> Section:
    rows = tuple(
        (
            condition.name,
            *(minus(f"{value:.6g}") for value in (condition.low, condition.mean, condition.high)),
            unit(condition.unit),
        )
        for condition in c.conditions
    )
    head = ("influence", "lowest", "mean", "highest", "unit")
    tables = (Table("During the measurement", head, rows, (1, 2, 3)),) if rows else ()
    facts = (("reference", c.reference), ("local gravity", f"{c.gravity_m_s2:.6g} m/s²"))
    return Section("Environment", (Facts(facts), *tables))


def results_table(c: Certificate) -> Table:
    """The results as left."""
    rows = tuple(
        (_name(o), expand_uncertainty(o.value, o.expanded), unit(o.unit), _coverage(o), freedom_text(o.freedom),
         *(("–", "–") if o.decision is None else (_limits(o.decision), _statement(o.decision))))
        for o in c.figures.outcomes
    )  # fmt: skip
    return Table(
        "Results, as left", ("quantity", "value ± U", "unit", "k", "ν_eff", "limits", "conformity"), rows, (1, 3, 4)
    )


def _results(c: Certificate) -> Section:
    words = (
        EXPANSION_TEXT,
        *([RULE] if any(o.decision for o in c.figures.outcomes) else [NO_LIMITS]),
        *c.figures.remarks,
        *c.remarks,
    )
    return Section("Results", (*words, results_table(c)))


def _as_found_section(c: Certificate) -> Section:
    """The results as found, if an earlier calibration is known; the error of indication in any case."""
    outcomes = [o for o in c.figures.outcomes if o.found is not None]
    changes = tuple(
        (_name(o), value_text(o.found[0], o.expanded), value_text(o.value, o.expanded),
         rounded(o.value - o.found[0], 2), unit(o.unit), f"{abs(o.value - o.found[0]) / o.expanded:.1f}")
        for o in outcomes if o.found is not None
    )  # fmt: skip
    errors = tuple(
        (e.axis, *([rounded(x) for x in e.found] if e.found else ["–", "–"]), *(rounded(x) for x in e.left), e.unit)
        for e in c.figures.errors
    )
    head = ("axis", "rms as found", "greatest as found", "rms as left", "greatest as left", "unit")
    tables = [Table("Error of indication over the poses of this calibration", head, errors, (1, 2, 3, 4))]
    if changes:
        change_head = ("quantity", "as found", "as left", "change", "unit", "change / U")
        tables.insert(0, Table("Change since the previous calibration", change_head, changes, (1, 2, 3, 5)))
    words = f"As found: by {c.before}." if c.before else "No values as found: no earlier calibration was given."
    return Section("As found and as left", (words, *tables))


def _uncertainty(c: Certificate) -> Section:
    budgets = tuple(
        Table(
            f"{_name(o)}, {unit(o.unit) or '1'}",
            SOURCE_HEAD,
            tuple(source.cells(o.std) for source in o.sources),
            (2, 3, 4, 5),
            folded=True,
        )
        for o in c.figures.outcomes
    )
    trials = tuple(
        (_name(o), rounded(o.std, 2), rounded(o.simulated.std, 2), rounded(o.expanded, 2),
         f"{value_text(o.simulated.low, o.expanded)} to {value_text(o.simulated.high, o.expanded)}", unit(o.unit),
         _check_text(o))
        for o in c.figures.outcomes
    )  # fmt: skip
    check = ("quantity", "u by the budget", "u simulated", "U", "95 % simulated", "unit", "budget")
    words = (
        BUDGET,
        *([f"Not given and not included: {', '.join(c.figures.not_given)}."] if c.figures.not_given else []),
        TRIALS.format(trials=c.figures.trials, scatter=END_SCATTER / math.sqrt(c.figures.trials)),
        *([CORRELATION_TEXT] if len(c.figures.outcomes) > 1 else []),
    )
    checked = Table("Check by simulation", check, trials, (1, 2, 3, 4))
    return Section("Uncertainty", (*words, checked, *_correlations(c), *budgets))


def _correlations(c: Certificate) -> Iterator[Table]:
    """The lower triangles of the correlation matrix, as many columns at a time as a page is wide."""
    names, r = [_name(o) for o in c.figures.outcomes], c.figures.correlations
    for first in range(0, len(names) if len(names) > 1 else 0, WIDE):
        columns = range(first, min(first + WIDE, len(names)))
        head = ("", "quantity", *(f"{k + 1}" for k in columns))
        rows = tuple(
            (f"{i + 1}", names[i], *(minus(f"{r[i][k]:.2f}") if k <= i else "" for k in columns))
            for i in range(first, len(names))
        )
        yield Table(
            "Correlation coefficients" + (", continued" if first else ""), head, rows, (0, *range(2, 2 + len(columns)))
        )


def _traceability(c: Certificate) -> Section:
    heavy = tuple(
        (_name(o), ", ".join(f"{number} ({100 * share:.0f} %)" for number, share in o.weights[:HEAVIEST]))
        for o in c.figures.outcomes
    )
    rows = tuple(
        (str(s.number), "–" if s.t_s is None else f"{s.t_s:.1f}", s.place,
         "  ".join(minus(f"{v:.6f}") for v in s.means), str(s.n), s.sha256[:16])
        for s in c.samples
    )  # fmt: skip
    facts = (
        ("data", c.data),
        ("SHA-256 of the data", c.data_sha256),
        ("SHA-256 of the model", c.model_sha256),
        ("issued by", c.program),
    )
    return Section(
        "Traceability",
        (
            ROWS,
            Facts(facts),
            Table("Rows with the largest weight in each result", ("quantity", "number of the row (its share)"), heavy),
            Table("Rows", ("row", "t, s", "pose", "mean outputs", "n", "SHA-256"), rows, (0, 1, 4), folded=True),
        ),
    )


def _name(o: Outcome) -> str:
    return f"{o.term}{f', {o.axis}' if o.axis else ''}"


def _coverage(o: Outcome) -> str:
    return f"{WIDENED}, {o.coverage:.2f}" if o.simulated.verdict == WIDENED else f"{o.coverage:.2f}"


def _check_text(o: Outcome) -> str:
    if o.simulated.verdict == CONSERVATIVE and o.simulated.why:
        return f"{CONSERVATIVE}: {o.simulated.why}"
    return f"{WIDENED} to the simulation" if o.simulated.verdict == WIDENED else o.simulated.verdict


def _limits(d: Decision) -> str:
    return minus(f"{d.low:g} to {d.high:g}")


def _statement(d: Decision) -> str:
    chance = "over 99.9" if d.probability > 0.999 else f"{100 * d.probability:.1f}"
    return f"{STATEMENTS[d.statement]} ({chance} %)"
