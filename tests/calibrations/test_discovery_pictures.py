"""Pictures of a discovery: the fall of the error as bars, the curve of each effect, and the album of all."""

from __future__ import annotations

from dataclasses import replace

import pytest
from matplotlib.text import Annotation

from calibrations.discovery.findings import Step
from calibrations.discovery.results import Discovery
from calibrations.fitting.fit import pool_in_milli
from calibrations.loop import compare
from calibrations.model.file import read_model
from calibrations.presentation.chart import Bars
from calibrations.presentation.charts.discovery import (
    MOST_CURVES,
    ErrorLevel,
    album,
    brief,
    levels,
    notable_steps,
    steps_album,
    waterfall,
)
from calibrations.presentation.interactive import figure
from calibrations.presentation.static import draw
from tests.calibrations.test_pictures import by_hand, dots, panels, warm, warm_table


def test_texts_of_many_bars_are_short() -> None:
    steps = [ErrorLevel(f"+ {k}", 10.0 - k, 11.0 - k, "3.8 mg") for k in range(9)]
    for count, text in ((8, "10.0 × (3.8 mg)"), (9, "10.0 ×")):
        (bars,) = [bars for bars in panels(waterfall(steps[:count]))[0].series if isinstance(bars, Bars)]
        assert bars.texts[0] == text


def test_an_error_far_below_the_noise_floor_has_a_bar() -> None:
    (panel,) = panels(waterfall([ErrorLevel("linear", 9.0, 9.5, "9 mg"), ErrorLevel("+ a", 0.3, 0.2, "0.1 mg")]))
    bars = next(series for series in panel.series if isinstance(series, Bars))
    assert panel.x.low is not None
    assert bars.base == panel.x.low < 0.3


def test_texts_of_bars_keep_their_size() -> None:
    (trace,) = [trace for trace in figure(waterfall(levels(warm())), "k")["data"] if trace["type"] == "bar"]
    assert trace["constraintext"] == "none"


def test_the_waterfall_falls_from_level_to_level() -> None:
    found = warm()
    (panel,) = panels(waterfall(levels(found)))
    bars = next(series for series in panel.series if isinstance(series, Bars))
    assert bars.ends.tolist() == [found.start.pooled_excess, found.end.pooled_excess]
    assert dots(panel).x.tolist() == [levels(found)[0].unseen, found.steps[0].held_out_after]
    assert panel.y.names == ("linear", "+ temperature-bias")
    assert bars.texts[0].endswith(f"× ({pool_in_milli(found.start)[0]:.2f} mg)")


def test_the_diamond_of_unseen_rows_covers_no_text_of_a_short_bar() -> None:
    chart = waterfall(
        [
            ErrorLevel("linear", 90.0, 95.0, "9 mg"),
            ErrorLevel("+ a", 1.0, 1.6, "0.1 mg"),
            ErrorLevel("+ b", 1.2, 1.1, "0.1 mg"),
        ]
    )
    shown = figure(chart, "waterfall")
    (bars,) = [trace for trace in shown["data"] if trace["type"] == "bar"]
    assert [bool(text.strip()) for text in bars["text"]] == [True, False, False]
    starts = [(note["text"].strip(), 10 ** note["x"], note["y"]) for note in shown["layout"]["annotations"]]
    assert starts == [("1.00 × (0.1 mg)", pytest.approx(1.6), 1), ("1.20 × (0.1 mg)", pytest.approx(1.2), 2)]
    printed = [
        text for text in draw(chart).axes[0].texts if isinstance(text, Annotation) and "0.1 mg" in text.get_text()
    ]
    assert [text.xy for text in printed] == [(pytest.approx(1.6), 1), (pytest.approx(1.2), 2)]


def test_the_name_of_a_model_with_many_effects_leaves_room_for_bars() -> None:
    assert brief("linear+hysteresis") == "linear+hysteresis"
    assert brief("linear+hysteresis+base-tilt+bias-drift") == "linear + 3 effects"
    assert brief("linear+a+b+c+d+free:history") == "linear + 5 effects"


def test_the_album_holds_every_picture_once() -> None:
    pictures = album(warm(), compare(warm_table(), read_model("linear")))
    names = [picture.name for picture in pictures]
    places = ["shares", "place-temperature-bias"]
    assert names == ["waterfall", "measurement", "residual", "failure", "effect-temperature-bias", *places]
    assert all(picture.title and picture.caption.endswith(".") for picture in pictures)


def test_only_a_stage_turns_clockwise() -> None:
    for found, is_turned in ((warm(), True), (by_hand(), False)):
        captions = [picture.caption for picture in steps_album(found) if picture.name.startswith("effect-")]
        assert captions
        assert all(("clockwise" in caption) == is_turned for caption in captions)


def test_only_the_greatest_falls_are_drawn() -> None:
    (step,) = warm().steps
    idle = [Step(f"e{k}", step.after, step.after) for k in range(MOST_CURVES)]
    findings = replace(warm().findings, steps=(*idle[:2], step, *idle[2:]))
    shown = notable_steps(Discovery.of(findings))
    assert step in shown
