"""The report is one valid page that holds every number it should, reaches nowhere, and escapes what users wrote."""

from __future__ import annotations

import html
import re
from collections import Counter
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from typing import Any

import pytest

from calibrations.design.expected import ExpectedResult
from calibrations.design.experiment import Experiment
from calibrations.discovery.results import Comparison, Discovery
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, pool_in_milli
from calibrations.loop import compare, discover
from calibrations.model import Estimate, Model, Term
from calibrations.model.file import read_model
from calibrations.presentation.chart import Chart, Panel, Picture
from calibrations.presentation.report.parameters import constant_facts, model_facts
from calibrations.presentation.report.report import _constant, next_takes, next_words, report, summary
from calibrations.presentation.residual import column_label
from calibrations.table import Table
from calibrations.text import estimate_in_prefix, few_digits, milli_amount, probability, rounded, typeset
from tests.calibrations.test_pictures import EFFECTS, by_hand, hand_table, warm, warm_table

EMPTY = {"meta", "br", "link", "hr", "img"}


class Page(HTMLParser):
    """Tags must close in order; ids, links and text are kept."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: Counter[str] = Counter()
        self.references: list[str] = []
        self.words: list[str] = []
        self.tags: Counter[str] = Counter()
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        given = dict(attrs)
        assert len(given) == len(attrs), f"an attribute of <{tag}> stands twice"
        if given.get("id"):
            self.ids[str(given["id"])] += 1
        self.references += [str(given[name]) for name in ("href", "src", "xlink:href", "srcset") if name in given]
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))


@cache
def beside() -> Comparison:
    return compare(warm_table(), read_model("linear"))


@cache
def page() -> str:
    return report(warm(), beside(), "2024-05-06", "inertial-rig 1.2.3")


@cache
def hand_page() -> str:
    return report(by_hand(), compare(hand_table(), read_model("common-scale")), "2024-05-06", "inertial-rig 1.2.3")


@cache
def nothing() -> Discovery:
    return discover(warm_table(0.0), read_model("linear"), EFFECTS)


def blank() -> list[Picture]:
    """Pictures that take no time to draw."""
    empty = Chart(((Panel(()),),))
    return [Picture(name, name, "Nothing.", empty) for name in ("waterfall", "measurement", "residual", "failure")]


def changed(found: Discovery[Fit], **values: Any) -> Discovery[Fit]:
    """A discovery with other findings, or another next experiment."""
    following = values.pop("next_experiment", found.next_experiment)
    return Discovery(replace(found.findings, **values), following)


@pytest.mark.parametrize("make", [page, hand_page])
def test_a_report_is_valid_html(make: object) -> None:
    read = Page(make())
    assert not read.open
    assert set(read.ids.values()) == {1}
    assert read.tags["h1"] == 1
    assert read.tags["svg"] == read.tags["figure"] == (7 if make is page else 5)


@pytest.mark.parametrize("make", [page, hand_page])
def test_a_report_loads_nothing_from_the_network(make: object) -> None:
    text = make()
    read = Page(text)
    assert "http" not in text
    assert "script" not in read.tags
    assert "@import" not in text
    assert all(reference.startswith(("#", "data:")) for reference in read.references)
    assert {reference[1:] for reference in read.references if reference.startswith("#")} <= set(read.ids)
    assert all(inside.startswith("#") for inside in re.findall(r"url\(([^)]*)\)", text))


def test_it_opens_with_the_verdict_and_the_falling_error() -> None:
    text = page()
    assert '<h1>The model "linear" misses temperature-bias.</h1>' in html.unescape(text)
    assert text.index("<h1>") < text.index("waterfall-") < text.index("Residuals of the model linear")
    assert "effect missing" in Page(text).text


def test_it_holds_the_errors_before_and_after() -> None:
    found, text = warm(), Page(page()).text
    (step,) = found.steps
    for value in (found.start.pooled_excess, found.end.pooled_excess, step.held_out_before, step.held_out_after):
        assert f" {rounded(value)} " in text
    for fit in (found.start, found.end):
        assert milli_amount(pool_in_milli(fit)[0], "mg", 2) in text
        for c in range(2):
            assert milli_amount(1e3 * fit.rmse[c], "mV") in text
            assert f"{rounded(1e6 * fit.noise.floor[c])} µV = " in text


def test_it_holds_every_place_where_the_model_fails() -> None:
    text = Page(page()).text
    assert beside().fails
    for place in beside().fails:
        assert typeset(place.text)[1:] in text


def test_a_report_lists_every_candidate() -> None:
    text = Page(page()).text
    for c in warm().findings.candidates:
        assert f"{c.name} {rounded(c.excess_after)} {rounded(c.held_out_after)} {probability(c.p_value)}" in text
    best = warm().findings.candidates[0].effect
    assert best.formula.split()[-1] in text
    assert best.symptom[1:] in text


def test_it_holds_every_parameter_with_its_uncertainty() -> None:
    text = Page(page()).text
    for term in warm().end.model.terms:
        for e in term.estimates:
            assert f"{e.name} {e.axis} {estimate_in_prefix(e.value, e.std, e.unit)}" in text
    reference = warm().end.model.terms[-1].constants["reference_c"]
    assert f"{few_digits(reference, 4)} (a reference value, not fitted)" in text


def test_it_says_why_a_parameter_is_not_identified() -> None:
    end = warm().end
    still = Estimate("bias", "x", 1.0, None, "V", False, "nothing moved")
    bias = Term(catalogue()["bias"], estimates=(still, *end.model.terms[0].estimates[1:]))
    model = Model("m", (bias, *end.model.terms[1:]))
    text = Page(
        report(
            changed(warm(), start=_with_model(end, model), baseline=_with_model(end, model), steps=()),
            beside(),
            "d",
            "p",
            blank(),
        )
    ).text
    assert "not identified: nothing moved" in text


def _with_model(fit: object, model: Model) -> object:
    from dataclasses import replace

    return replace(fit, model=model)  # type: ignore[type-var]


def test_it_holds_the_results_that_have_a_limit() -> None:
    results = {
        "rmse-linear-x": {"value": 12.5, "std": 0.3, "unit": "mm/s2", "limit": [0, 10], "verdict": "fail"},
        "amplitude": {"value": 2.0, "std": None, "unit": "m/s2", "limit": None, "verdict": None},
    }
    text = report(warm(), beside(), "2026-07-31", "rig 1", blank(), results=results)
    (row,) = [part for part in text.split("<tr>") if "rmse-linear-x" in part]
    assert all(part in row for part in ("12.50(30)", "fail"))
    assert "amplitude" not in text
    assert "Verdicts" not in page()


def test_a_report_states_the_noise() -> None:
    text = Page(page()).text
    noise = warm().end.noise
    for c in range(2):
        assert f"{rounded(1e6 * noise.floor[c])} µV = " in text
        if noise.scatter[c] > 1e-3 * noise.floor[c]:
            assert milli_amount(1e3 * noise.scatter[c], "mV") in text
    assert "from the residual of the final model" in text


def test_it_holds_the_provenance_and_no_path_of_this_machine() -> None:
    table = Table.from_columns("poses", warm_table().columns, {"serial": "A 7"}, "/home/somebody/secret/run.csv")
    model = Model("given", read_model("linear").terms, provenance={"data": r"C:\secret\old.csv", "rows": 12})
    text = report(discover(table, model, EFFECTS), compare(table, model), "2024-05-06", "inertial-rig 1.2.3", blank())
    words = Page(text).text
    assert "secret" not in text
    for fact in ("run.csv", "old.csv", table.digest, "A 7", "inertial-rig 1.2.3", "2024-05-06", "250 poses", "9.80665"):
        assert fact in words


@pytest.mark.slow
def test_what_users_wrote_is_escaped() -> None:
    table = Table.from_columns("poses", warm_table().columns, {"sensor": "<script>alert(1)</script>"}, "<b>.csv")
    model = Model("<i>mine</i> & co", read_model("linear").terms)
    text = report(discover(table, model, EFFECTS), compare(table, model), "<u>", "p")
    assert not {"script", "i", "u"} & set(Page(text).tags)
    assert "&lt;script&gt;" in text


def test_the_same_arguments_give_the_same_page() -> None:
    """Pictures: `test_the_same_chart_gives_the_same_bytes`."""
    first, second = (report(warm(), beside(), "2024-05-06", "inertial-rig 1.2.3", blank()) for _ in range(2))
    assert first == second


def test_positions_are_told_as_positions() -> None:
    text = Page(hand_page()).text
    assert "positions not used in the fit" in text
    assert "norm" in text
    assert "poses" not in text.replace("poses.", "")


def test_nothing_missing_is_said_so() -> None:
    assert nothing().outcome == "adequate"
    assert nothing().judgement.headline == "No effect is missing."
    assert "On 250 poses its rms error is 51 µg, 1.01 × the noise floor of 50 µg." in summary(nothing())


def test_doubt_is_said_so_with_the_experiment_that_ends_it() -> None:
    e = Experiment("sweep", {"flip": 1}, (("a", "b"), ("a", "c")), "it turns")
    found = changed(warm(), alternatives={"temperature-bias": ("warm-up-bias", "drift")}, next_experiment=e)
    assert "temperature-bias from warm-up-bias or drift" in found.judgement.text
    assert found.verdict == "ambiguous"
    assert next_words(e) == "To separate a from b or c, run sweep with flip = 1: it turns."
    assert next_words(e) in Page(report(found, beside(), "d", "p", blank())).text


def test_the_next_experiment_stands_with_its_command_and_what_it_brings() -> None:
    bare = Experiment("sweep", {}, (("temperature-bias", "warm-up-bias"),), "it turns")
    e = replace(
        bare, command="rig run sweep --bench b.yaml", duration_s=3827.0, expected=ExpectedResult(1.0, 400.0, 1.0)
    )
    assert next_takes(bare) == ""
    assert next_takes(replace(e, duration_s=50835.0, expected=None)).startswith("It takes 14.1 h. Its result cannot")
    brings = "It takes 64 min and separates them with a probability of 99.9 %, from all data together."
    assert next_takes(e) == brings
    found = changed(warm(), alternatives={"temperature-bias": ("w",)}, next_experiment=e)
    page = report(found, beside(), "d", "p", blank())
    assert "<pre>rig run sweep --bench b.yaml</pre>" in page
    assert brings in Page(page).text


def test_the_page_names_the_pattern_of_an_unexplained_residual() -> None:
    dropped = warm().findings.without_steps()
    found = Discovery.of(replace(dropped, left="step at t = 3120 s"))
    assert found.judgement.text == "No effect of the catalogue explains the residual: step at t = 3120 s."
    text = Page(report(found, beside(), "d", "p")).text
    assert "Pattern of the residual: step at t = 3120 s." in text
    assert "This effect was tried and not kept" in text


def test_a_pattern_has_the_signs_of_a_page() -> None:
    found = Discovery.of(replace(warm().findings.without_steps(), left="scatter at -3 degC, 3.4 x the noise floor"))
    text = Page(report(found, beside(), "d", "p", blank())).text
    assert text.count("scatter at −3 °C, 3.4 × the noise floor") == 4  # title, headline, summary, next experiment
    assert "3.4 x" not in text


def test_the_provenance_has_labels_and_readable_times() -> None:
    constants = {
        "serial": 1234567.0,
        "noise_inflation_x": 0.9828633900152628,
        "sample_rate_hz": 1000.0,
        "interruptions": "2026-11-29T21:07:36Z stopped by a person",
    }
    assert constant_facts(constants) == {
        "constant: serial": "1234567",
        "constant: noise inflation x": "0.983",
        "constant: sample rate (Hz)": "1000",
        "constant: interruptions": "2026-11-29 21:07:36 UTC stopped by a person",
    }
    model = replace(read_model("linear"), provenance={"data_sha256": "ab", "created": "2026-11-29T21:07:36+00:00"})
    assert model_facts(model) == {
        "model given": "linear",
        "model given: data sha256": "ab",
        "model given: created": "2026-11-29 21:07:36 UTC",
    }


def test_reference_values_of_a_gyroscope_are_in_words() -> None:
    docs = catalogue()["gyro-scale-factor"].constant_docs
    assert docs["turned_x"].startswith("turns about x")
    assert set(docs) == {"turned_x", "turned_y", "turned_z", "assumed"}
    term = replace(read_model("gyroscope").terms[-1], effect=catalogue()["gyro-scale-factor"])
    assert _constant(term, "turned_x", 1.0) == ("turns about x measured", "–", "yes", "")
    assert _constant(term, "turned_x", 0.0)[2] == "no"
    text = Page(page()).text
    assert "reference (°C)" in text
    assert "reference_c" not in text


def test_columns_have_labels_with_their_units() -> None:
    assert column_label("az") == "specific force along z (g)"
    assert column_label("az", ("ax", "ay", "az")) == "az"  # an output of the sensor
    assert column_label("pressure_m_s2") == "pressure (m/s²)"
    assert column_label("vx_v") == "vx (V)"
    assert column_label("s") == "s"
