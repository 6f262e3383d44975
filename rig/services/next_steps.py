"""Results of a run as a table, and the next steps: for each verdict that is not a pass, and for the measured data."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from calibrations.tables import FITTED_KINDS
from calibrations.text import (
    bound,
    columns,
    concise,
    estimate_text,
    few_digits,
    in_prefix,
    join_words,
    positive_text,
    rounded,
    unit,
)
from rig.bench.result_names import label
from rig.record import Run
from rig.services.page_words import PageStep, page_step

SPREADS = re.compile("tolerance|wander|residual")  # uncertainties themselves
RELATIVE = {"": "%", "1/K": "%/K"}  # units of a relative change, by that of the result
REPEATED = re.compile("(bias|scale)-(as-is|power|mount)")  # spreads with an uncertainty, at least 0
FACTORS = re.compile("correction-")  # of a matrix near 1: all with the same decimals
SPREAD_DIGITS, TIME_DIGITS, FACTOR_DECIMALS = 2, 3, 6
# By the name of a result that is beyond its limit: what to look at. The first that fits counts.
REMEDIES = {
    r"level-offset": "the half turn removes the offset of the level from the tilt; have the level adjusted",
    r"level-": "level the base, set the zero of alpha, then: rig run level-check",
    r"noise-(rms|pp)|inclination": "look for vibration, loose cables and a noisy supply, then measure again",
    r"theta-|alpha-|beta-|non-orthogonality|correction": "mount the sensor again and repeat the search; a part "
    "that remains belongs to the sensor, and the results named correction remove it",
    r"(bias|scale)-temperature": "correct for temperature: rig discover {run} finds the effect and its size",
    r"(bias|scale)-(as-is|power|mount)": "check screws, connector and supply, and let the sensor warm up: rig run soak",
    r"rmse|improvement|amplitude|noise-limit": "see where the model fails: rig compare {run}; "
    "then check how sensor and displacement sensor are mounted on the carriage",
    r"(hard|soft)-iron|left-by|field-": "move iron and magnets away from the sensor; iron that turns with it is "
    "in the model: rig fit {run} --model magnetometer",
    r"gyro-|rate-": "mount the sensor again; a part that remains belongs to the sensor: rig discover {run} finds "
    "its model",
    r"drift|steady|time-constant|wander": "let the sensor warm up longer, away from drafts, before use or calibration",
    r"gap": "the run was interrupted: rig show {run} shows when",
    r"": "look for poses that differ from the others: rig show {run} --poses; rig exclude leaves one out, with "
    "a reason",
}
NOISE_ALONE = (
    "These uncertainties include the noise alone, for the control chart; those of a fitted model include its error too"
)
LENGTHS = ("duration_s", "times", "cycles", "most_rounds", "dwell_s")  # settings by which a procedure measures longer
LONGER = 4  # times as long halves a statistical uncertainty


def next_steps(run: Run, excluded: Mapping[int, str]) -> list[str]:
    """The next steps after a run: for each verdict that is not a pass, and with the measured data."""
    return [*_advice(run, excluded, str), *_advise_on_limits(run.results), *_commands(run)]


def _advice(run: Run, excluded: Mapping[int, str], name_text: Callable[[str], str]) -> list[str]:
    """The steps that concern the measurement itself. `name_text` writes the name of a result."""
    return [
        *([NOISE_ALONE] if run.procedure == "check-standard" and run.results else []),
        *_advise_on_excluded(excluded),
        *_advise_on_failures(run, name_text),
        *_marginal(run, name_text),
    ]


def _advise_on_excluded(excluded: Mapping[int, str]) -> Iterator[str]:
    if excluded:
        yield f"Left out: {'; '.join(f'pose {number} ({reason})' for number, reason in excluded.items())}"


def _advise_on_failures(run: Run, name_text: Callable[[str], str]) -> Iterator[str]:
    """Results beyond their limits, those of one remedy together."""
    by_remedy: dict[str, list[str]] = {}
    for name in _with_verdict(run.results, "fail"):
        remedy = next(text for pattern, text in REMEDIES.items() if re.match(pattern, name.rpartition("/")[2]))
        by_remedy.setdefault(remedy, []).append(name)
    for remedy, names in by_remedy.items():
        yield f"Fail: {join_words(map(name_text, names))}: {remedy.format(run=run.run)}"


def _marginal(run: Run, name_text: Callable[[str], str]) -> Iterator[str]:
    """The value is too close to the limit; a longer measurement decides."""
    if names := _with_verdict(run.results, "marginal"):
        setting = next((name for name in LENGTHS if name in run.settings), None)
        longer = f" (--{setting.replace('_', '-')} {LONGER * run.settings[setting]:g})" if setting else ""
        verb = "reach" if len(names) > 1 else "reaches"
        yield (
            f"Marginal: {join_words(map(name_text, names))} {verb} across the limit with its uncertainty; "
            f"{LONGER} times the duration{longer} halves the uncertainty"
        )


def _with_verdict(results: Mapping[str, Any], verdict: str) -> list[str]:
    return [name for name, result in results.items() if result["verdict"] == verdict]


def _advise_on_limits(results: Mapping[str, Any]) -> Iterator[str]:
    """A remark that a result without a limit has no verdict, and how to give it one."""
    if name := _without_limit(results):
        short = name.rpartition("/")[2]
        yield f"No verdict without a limit: add one to limits.results of the bench file, such as `{short}: ...`"


def _without_limit(results: Mapping[str, Any]) -> str:
    """The name of the first result without a limit; "" for none."""
    return next((name for name, result in results.items() if result["limit"] is None), "")


def _commands(run: Run) -> Iterator[str]:
    """The usual next command."""
    if run.state != "complete":
        yield f"Next: rig resume {run.run}"
    elif run.procedure == "check-standard":
        yield "Next: rig control"
    elif run.rows and run.kind in FITTED_KINDS:
        data = run.data[0]
        if run.procedure == "soak":
            yield f"Next: rig report {data} --out night.html"
            return
        yield f"Next: rig compare {data}, rig discover {data}, rig report {data} --out report.html"


# The same on a page.


def page_steps(run: Run, excluded: Mapping[int, str]) -> list[PageStep]:
    """`next_steps` for a page."""

    def quoted(name: str) -> str:
        return f'"{label(run.procedure, name)}"'

    lines = (line.replace(f" {run.run}", "") for line in _advice(run, excluded, quoted))
    steps = [page_step(line, run.run, run.procedure) for line in lines]
    if name := _without_limit(run.results):
        steps.append(
            PageStep(
                f"No verdict without a limit. Write limits under limits.results in the bench file, for {quoted(name)} "
                "for example; the last column of the table has the names of the results there.",
                {},
            )
        )
    if run.state != "complete":
        steps.append(PageStep("The run is not complete. Resume it on the page Run.", {"Run": "/run"}))
    elif run.procedure == "check-standard":
        steps.append(PageStep("The history compares it with the earlier runs of this sensor.", {"History": "/history"}))
    return steps


def results_table(results: Mapping[str, Any]) -> list[str]:
    """A table of the results of a run, none where it has none."""
    if not results:
        return []
    rows = result_rows(results, _value_in_terminal)
    cells = [(row.name, row.value, _ascii(row.limit) or "-", row.verdict) for row in rows]
    return columns(("result", "value", "limit", "verdict"), cells).splitlines()


# The rows of the table. A result that is yes or no, or a forecast, is a sentence.

STEADY = re.compile(r"(?P<sensor>.*/)?steady-state(?P<axis>-\w)?")
FORECAST = ("earliest", "expected", "latest")
NOT_CONFIRMED = "Not confirmed in this run."  # also where the forecast is the end of the run


@dataclass(frozen=True)
class ResultRow:
    """One row: `limit` and `verdict` are "" without a limit."""

    name: str
    value: str
    limit: str
    verdict: str


def _value_on_page(name: str, result: Mapping[str, Any]) -> str:
    value, std, unit_name = _readable(name, result)
    return f"{_number_text(name, result, value, std) or estimate_text(value, std)} {unit(unit_name)}".rstrip()


def _number_text(name: str, result: Mapping[str, Any], value: float, std: float | None) -> str:
    """The number of a result that its uncertainty does not round; "" for another one."""
    if (digits := _digits(name, result)) is not None:
        return few_digits(value, digits)
    if not std:
        return f"{value:.{FACTOR_DECIMALS}f}" if FACTORS.match(name.rpartition("/")[2]) else few_digits(value)
    return positive_text(value, std) if REPEATED.match(name.rpartition("/")[2]) else ""


def result_rows(
    results: Mapping[str, Any], value_text: Callable[[str, Mapping[str, Any]], str] = _value_on_page
) -> list[ResultRow]:
    """The rows on a page. The steady state of a soak is one sentence, with its time or its forecast.

    `value_text` writes a result by its name.
    """
    rows: list[ResultRow] = []
    listed: set[str] = set()
    for name, r in results.items():
        if name in listed:
            continue
        limit, verdict = "" if r["limit"] is None else _limit_text(name, r), r["verdict"] or ""
        if (steady := STEADY.fullmatch(name)) is not None:
            times = _steady_times(results, steady)
            listed |= {part for part in times.values() if results[part]["limit"] is None}
            value = _steady_sentence(bool(r["value"]), {end: results[part] for end, part in times.items()})
            limit = "must be reached" if limit else ""
        elif name.rpartition("/")[2] == "gap" and not r["value"]:
            value = "none"
        else:
            value = value_text(name, r)
        rows.append(ResultRow(name, value, limit, verdict))
    return rows


def _steady_times(results: Mapping[str, Any], steady: re.Match[str]) -> dict[str, str]:
    """The names of the results with the time of a steady state and its forecast, by kind of time."""
    sensor, axis = steady["sensor"] or "", steady["axis"] or ""
    names = {end: f"{sensor}steady-state-{end}{axis}" for end in ("time", *FORECAST)}
    return {end: name for end, name in names.items() if name in results}


def _steady_sentence(reached: bool, parts: Mapping[str, Any]) -> str:
    """Whether and when the sensor is steady. `parts`: the results of the time and of its forecast that there are."""
    times = {end: f"{rounded(r['value'], TIME_DIGITS)} {r['unit']}" for end, r in parts.items()}
    if reached:
        if "time" not in times:
            return "Reached."
        time = parts["time"]
        return f"Reached {positive_text(time['value'], time['std'])} {time['unit']} after power-on."
    if "expected" in times:
        interval = f", {times['earliest']} to {times['latest']} (95 %)" if times["earliest"] != times["latest"] else ""
        return f"{NOT_CONFIRMED} Forecast: steady {times['expected']} after power-on{interval}."
    if "earliest" in times:
        return f"{NOT_CONFIRMED} Forecast: not steady before {times['earliest']} after power-on."
    return f"{NOT_CONFIRMED} There is no forecast."


def _value_in_terminal(name: str, result: Mapping[str, Any]) -> str:
    value, std, unit_name = _readable(name, result)
    text = _number_text(name, result, value, std) or concise(value, std)
    return _ascii(f"{text} {unit_name}".rstrip())


def _ascii(text: str) -> str:
    return text.replace("µ", "u").replace("−", "-")


def _limit_text(name: str, result: Mapping[str, Any]) -> str:
    """The limit in the prefix that reads best, which may be another one than that of the value."""
    limit = result["limit"]
    ends = limit if isinstance(limit, Sequence) else [limit]
    factor, unit_name = _scale(name, max(map(abs, ends)), None, result["unit"])
    scaled = [end * factor for end in ends]
    return f"{bound(result['value'], scaled if isinstance(limit, Sequence) else scaled[0])} {unit(unit_name)}".rstrip()


def _readable(name: str, result: Mapping[str, Any]) -> tuple[float, float | None, str]:
    """Value, standard uncertainty and unit of a result in the prefix that reads best."""
    std = result["std"] if _digits(name, result) is None else None
    factor, unit_name = _scale(name, result["value"], std, result["unit"])
    return result["value"] * factor, None if std is None else std * factor, unit_name


def _scale(name: str, value: float, std: float | None, unit_name: str) -> tuple[float, str]:
    """Factor and unit: relative changes in %, outputs with a prefix."""
    if name.rpartition("/")[2].startswith(("scale-", "improvement-")) and unit_name in RELATIVE:
        return 100.0, RELATIVE[unit_name]
    return in_prefix(value, std, unit_name)


def _digits(name: str, result: Mapping[str, Any]) -> int | None:
    """The digits of a spread, and of a time without an uncertainty; None for a result that its uncertainty rounds."""
    if SPREADS.search(name):
        return SPREAD_DIGITS
    return TIME_DIGITS if result["unit"] == "h" and not result["std"] else None
