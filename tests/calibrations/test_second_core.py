"""Pictures on two cores: the same as on one, also if the second process ends or never begins."""

from __future__ import annotations

import io
import pickle
import sys
from collections import OrderedDict
from collections.abc import Iterator
from threading import Thread

import numpy as np
import pytest

from calibrations.presentation import static
from calibrations.presentation.chart import Panel, Picture, Points, single_chart
from calibrations.presentation.second_core import SecondCore, serve


def picture(at: float) -> Picture:
    points = Points(np.array([1.0, 2.0]), np.array([0.5, at]))
    return Picture(f"at-{at:g}", "Two points", "One of them moves.", single_chart(Panel((points,))))


PICTURES = [picture(at) for at in (1.5, 2.5, 3.5, 4.5)]


@pytest.fixture
def core(monkeypatch: pytest.MonkeyPatch) -> Iterator[SecondCore]:
    monkeypatch.setattr(static, "_DRAWN", OrderedDict())
    made = SecondCore()
    yield made
    made.stop()


def elements() -> list[str]:
    """The pictures as their page has them, without drawing one."""
    contents = [pickle.dumps((each.chart, each.name, each.words)) for each in PICTURES]
    return [static.drawn(content) or "" for content in contents]


def drawn_here() -> list[str]:
    return [static._draw_inline(each.chart, each.name, each.words) for each in PICTURES]


def test_pictures_are_the_same_as_without_a_second_process(core: SecondCore) -> None:
    core.start()
    core.draw(PICTURES)
    assert elements() == drawn_here()
    assert [static.inline(each.chart, each.name, each.words) for each in PICTURES] == elements()


def test_pictures_drawn_ahead_are_in_memory(core: SecondCore, monkeypatch: pytest.MonkeyPatch) -> None:
    core.start()
    core.draw_ahead(PICTURES).join(60)
    here = drawn_here()
    monkeypatch.setattr(static, "_draw_inline", lambda *_: "drawn again")
    core.draw(PICTURES)
    assert elements() == here


def test_a_page_that_needs_pictures_ends_the_drawing_ahead(core: SecondCore) -> None:
    core.start()
    with core._lock:  # the second process is not free yet
        ahead = core.draw_ahead(PICTURES)
        page = Thread(target=core.draw, args=([],))
        page.start()
        for _ in range(500):
            if not core._ahead:
                break
            page.join(0.01)
    ahead.join(60)
    page.join(60)
    assert not any(elements())


@pytest.mark.parametrize("program", ["raise SystemExit", "print('no picture')"])
def test_a_second_process_that_fails_costs_no_picture(core: SecondCore, program: str) -> None:
    core.command = (sys.executable, "-c", program)
    core.start()
    core.draw(PICTURES)
    assert elements() == drawn_here()


def test_without_a_second_process_all_are_drawn(core: SecondCore) -> None:
    core.command = ("/no/such/program",)
    core.start()
    core.draw(PICTURES)
    assert elements() == drawn_here()


def test_the_second_process_draws_until_its_input_ends() -> None:
    asked = io.BytesIO(b"".join(pickle.dumps((each.chart, each.name, each.words)) for each in PICTURES[:2]))
    serve(asked, answers := io.BytesIO())
    answers.seek(0)
    assert [pickle.load(answers) for _ in range(2)] == drawn_here()[:2]  # noqa: S301 written above


def test_a_process_that_loses_the_first_one_ends(core: SecondCore) -> None:
    core.start()
    process = core._process
    assert process is not None
    assert process.stdin is not None
    process.stdin.close()
    assert process.wait(60) == 0
