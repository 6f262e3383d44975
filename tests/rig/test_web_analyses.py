"""The analyses of a server: what it loads ahead of the first one, and that a closed page ends its own."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager, closing
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import cast
from urllib.parse import quote

import pytest
from nicegui import Client, ui
from nicegui.testing import User, user_simulation
from starlette.types import Message, Receive, Scope, Send

from calibrations.presentation import static
from procedures.catalogue import Procedure
from procedures.settings import setting_label
from rig.bench import DEFAULT, Bench
from rig.planning.plan import plan
from rig.services.report import make_report
from rig.services.request import Request
from rig.services.search import Cancelled, CountedEffects
from rig.services.session import ModelSession
from rig.web.calculations import Visit, begin, off_loop
from rig.web.desk import Desk
from rig.web.pages import register
from rig.web.pages.run_report import draw_ahead, report_html
from rig.web.server import LeftPages
from tests.browser.measured import hidden, two_faults

SEARCH = "diagnosed"  # the thread of a search has the name of what it computes
FIRST_ANALYSIS = """import sys
from calibrations.means import kernels
from calibrations.presentation import static
from calibrations.presentation.second_core import SecondCore
from rig.services.request import Request
from rig.services.session import model_session
from rig.web.server import load_ahead

loops = [each for each in vars(kernels).values() if hasattr(each, "nopython_signatures")]
load_ahead(SecondCore(("/no/such/program",)))
ahead = [each.nopython_signatures for each in loops]
session = model_session(Request(sys.argv[1]))
session.compared()
print(any(ahead), len(static._DRAWN) > 0, ahead == [each.nopython_signatures for each in loops])
"""


@asynccontextmanager
async def without_browser() -> AsyncIterator[User]:
    """Pages that a person visits without a browser."""
    async with user_simulation() as user:
        try:
            yield user
        finally:  # NiceGUI would take the modules of these pages from Python, and all that they lie in
            Client.page_routes.clear()


def searches() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == SEARCH]


@pytest.mark.parametrize("closed", [True, False])
def test_a_closed_page_ends_its_search(closed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIG_HOME", str(tmp_path / "home"))
    data, desk, iterate = two_faults(tmp_path), Desk(DEFAULT), CountedEffects.__iter__
    begun, go = threading.Event(), threading.Event()

    def held(effects: CountedEffects) -> Iterator[str]:
        begun.set()
        assert go.wait(60)
        yield from iterate(effects)

    monkeypatch.setattr(CountedEffects, "__iter__", held)

    async def simulated() -> None:
        async with without_browser() as user:
            register(desk)
            client = await user.open(f"/?data={quote(data)}&model=linear")
            try:
                await user.should_see("Searching for missing effects", retries=200)
                assert await asyncio.to_thread(begun.wait, 60)
                [search] = searches()
                if closed:
                    client.delete()
            finally:
                go.set()
            await asyncio.to_thread(search.join)

    asyncio.run(simulated())
    assert not searches()
    (session,) = desk.sessions.values()
    assert bool(session.plans) is not closed


@pytest.mark.parametrize(("code", "left"), [(1001, True), (1005, False), (1006, False)])
def test_a_page_ends_at_once_if_its_browser_leaves_it_but_not_if_the_connection_is_lost(code: int, left: bool) -> None:
    async def simulated() -> None:
        async with without_browser() as user:

            @ui.page("/visited")
            def visited() -> None:
                ui.label("visited")

            client = await user.open("/visited")
            messages = [{"type": "websocket.receive", "text": "2"}, {"type": "websocket.disconnect", "code": code}]

            async def receive() -> Message:
                return messages.pop(0)

            async def send(_: Message) -> None: ...

            async def connection(_: Scope, receive: Receive, __: Send) -> None:
                while (await receive())["type"] != "websocket.disconnect":
                    assert not client.is_deleted

            scope = {"type": "websocket", "query_string": f"client_id={client.id}&EIO=4".encode()}
            await LeftPages(connection)(scope, receive, send)
            assert client.is_deleted is left

    asyncio.run(simulated())


@pytest.mark.parametrize("closed", [True, False])
def test_a_plan_ends_with_its_page_and_with_its_settings(
    closed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RIG_HOME", str(tmp_path / "home"))
    begun, go = threading.Event(), threading.Event()

    def endless(*_: object) -> None:
        begun.set()
        while not go.is_set():
            pass

    def planned(bench: Bench, procedure: Procedure, settings: Mapping[str, object]) -> object:
        return endless() if settings["step_deg"] == 45 else plan(bench, procedure, settings)

    monkeypatch.setattr("rig.web.pages.run.plan", planned)

    async def simulated() -> None:
        async with without_browser() as user:
            register(Desk(DEFAULT))
            try:
                client = await user.open("/run?procedure=sweep&step_deg=45")
                assert await asyncio.to_thread(begun.wait, 60)
                [planning] = [thread for thread in threading.enumerate() if thread.name == "_plan"]
                if closed:
                    client.delete()
                else:
                    user.find(kind=ui.input, content="step (deg)").clear().type("90")
                    await user.should_see("70 poses", retries=200)
                await asyncio.to_thread(planning.join, 60)
                assert not planning.is_alive()
            finally:
                go.set()

    asyncio.run(simulated())


def test_a_failed_search_leaves_no_page_that_searches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIG_HOME", str(tmp_path / "home"))
    data = two_faults(tmp_path)

    def fails(_: object) -> None:
        raise ValueError

    monkeypatch.setattr(ModelSession, "diagnosed", fails)

    async def simulated() -> None:
        async with without_browser() as user:
            register(Desk(DEFAULT))
            await user.open(f"/?data={quote(data)}&model=linear")
            await user.should_see("The search for effects failed", retries=200)
            await user.should_see("Not diagnosed")

    asyncio.run(simulated())


def test_a_cancelled_calculation_ends_at_its_next_line() -> None:
    begun = threading.Event()

    def endless() -> None:
        begun.set()
        while True:
            pass

    calculation = begin(endless)
    assert begun.wait(60)
    calculation.cancel()
    with pytest.raises(Cancelled):
        calculation.future.result(60)
    calculation.thread.join(60)
    assert not calculation.thread.is_alive()
    calculation.cancel()  # after the end: nothing happens


@pytest.mark.parametrize(
    "module", ["numba.core.compiler_lock", "llvmlite.binding.executionengine", "importlib._bootstrap"]
)
def test_a_cancellation_waits_for_the_end_of_a_compilation_or_an_import(module: str) -> None:
    """An exception there leaves a lock that nobody opens, and every later calculation would wait."""
    entered, cancelled, left = threading.Event(), threading.Event(), threading.Event()

    def compile_function() -> None:
        entered.set()
        for _ in range(1000):
            cancelled.wait(10)
        left.set()

    namespace = {"__name__": module, "__builtins__": __builtins__}
    guarded = FunctionType(compile_function.__code__, namespace, closure=compile_function.__closure__)

    def work() -> None:
        guarded()
        while True:
            pass

    calculation = begin(work)
    assert entered.wait(10)
    calculation.cancel()
    cancelled.set()
    with pytest.raises(Cancelled):
        calculation.future.result(10)
    assert left.is_set()


def test_the_error_of_a_cancelled_compiled_call_is_no_fault() -> None:
    begun = threading.Event()

    def endless() -> None:
        begun.set()
        try:
            while True:
                pass
        except Cancelled as cancellation:
            raise SystemError from cancellation

    calculation = begin(endless)
    assert begun.wait(60)
    calculation.cancel()
    with pytest.raises(Cancelled):
        calculation.future.result(60)


def test_nothing_follows_a_calculation_whose_page_was_closed() -> None:
    """Not even an error: the server's log would call it a fault of the program."""
    go, ended, said = threading.Event(), asyncio.Event(), list[str]()

    def work(fails: bool) -> None:
        assert go.wait(60)
        if fails:
            raise ValueError

    async def simulated() -> None:
        async with without_browser() as user:

            @ui.page("/visited")
            def visited() -> None:
                for fails in (False, True):
                    ui.timer(0.0, lambda fails=fails: show(fails), once=True)

            async def show(fails: bool) -> None:
                try:
                    await off_loop(work, fails)
                    said.append("result")
                except Exception:
                    said.append("error")
                finally:
                    ended.set()

            client = await user.open("/visited")
            await asyncio.sleep(0.2)
            client.delete()
            go.set()
            await asyncio.wait_for(ended.wait(), 60)
            await asyncio.sleep(0.1)

    asyncio.run(simulated())
    assert said == []


def test_a_visit_ends_its_searches_and_its_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIG_HOME", str(tmp_path / "home"))
    visits: list[Visit] = []

    async def simulated() -> None:
        async with without_browser() as user:

            @ui.page("/visited")
            def visited() -> None:
                ui.label("visited")
                visits.append(Visit())

            client = await user.open("/visited")
            visits[0].check()
            client.delete()

    asyncio.run(simulated())
    with pytest.raises(Cancelled):
        visits[0].check()
    with pytest.raises(Cancelled):  # a report fits the model, and is left before the search
        make_report(Request(two_faults(tmp_path), "linear"), print, visits[0].searched)


@pytest.mark.slow
def test_a_report_drawn_ahead_draws_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    desk, data = Desk(None), two_faults(tmp_path)
    with closing(desk):
        session = desk.beginning(data)
        session.diagnosed()
        draw_ahead(desk, data, session).join(60)
        monkeypatch.setattr(static, "_draw_inline", lambda *_: "drawn here")
        visit = SimpleNamespace(searched=CountedEffects)
        text = report_html(desk, Request(data), cast(Visit, visit), lambda: session, plans_next=False)
    assert text.count("<svg") >= 5
    assert "drawn here" not in text


@pytest.mark.slow
def test_the_first_visit_after_a_search_draws_its_report_ahead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    desk, data, drawn = Desk(DEFAULT), two_faults(tmp_path), list[str]()
    monkeypatch.setattr("rig.web.pages.model.draw_ahead", lambda _, data, __: drawn.append(data))

    async def simulated() -> None:
        async with without_browser() as user:
            register(desk)
            for _ in range(2):
                await user.open(f"/?data={quote(data)}")
                await user.should_see("Missing, in the order in which they are added", retries=600)
                await asyncio.sleep(0.2)

    asyncio.run(simulated())
    assert drawn == [data]


@pytest.mark.slow
def test_the_first_analysis_loads_no_machine_code(tmp_path: Path) -> None:
    words = [sys.executable, "-c", FIRST_ANALYSIS, hidden(tmp_path, "package turned")]
    ended = subprocess.run(words, capture_output=True, text=True, check=True)
    assert ended.stdout == "True True True\n"


def test_a_setting_has_its_unit_or_what_it_counts() -> None:
    assert setting_label("step_deg") == "step (deg)"
    assert setting_label("reference_every") == "poses between two references"
    assert setting_label("face") == "face"
    assert setting_label("peak_to_peak_um") == "peak to peak (µm)"
