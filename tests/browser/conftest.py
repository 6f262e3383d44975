"""A real browser on a real server: `rig web` in a process of its own, Chromium driven by playwright.

Every page is watched: an error in it or in its console, a failed request, or a request to another computer fails the
test. RIG_SCREENSHOTS names a folder in which the pictures that tests take are kept.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import (
    Browser,
    BrowserContext,
    ConsoleMessage,
    Page,
    Request,
    Response,
    expect,
    sync_playwright,
)

SIZE = {"width": 1280, "height": 720}
TABLET = {"width": 768, "height": 1024}
PATIENCE_MS = 150_000  # for a search of missing effects, while other tests run
LEFT = "net::ERR_ABORTED"  # the page was left, or the answer is a download
LOCAL = ("http://127.0.0.", "ws://127.0.0.", "data:", "blob:")  # addresses on this computer
expect.set_options(timeout=PATIENCE_MS)


class Watch:
    """What went wrong in the pages of browser contexts."""

    def __init__(self) -> None:
        self.faults: list[str] = []

    def over(self, context: BrowserContext) -> BrowserContext:
        """Watch all pages of `context`."""
        context.on("weberror", lambda error: self._failed(str(error.error)))
        context.on("console", self._written)
        context.on("request", self._asked)
        context.on("requestfailed", self._broken)
        context.on("response", self._refused)
        return context

    def expects(self, fault: str) -> None:
        """Take off the faults with this text, which the test causes on purpose. Without one the test fails."""
        kept = [each for each in self.faults if fault not in each]
        assert len(kept) < len(self.faults), f"no fault says {fault!r}: {self.faults}"
        self.faults = kept

    def _failed(self, error: str) -> None:
        self.faults.append(f"an error in the page: {error}")

    def _written(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            self.faults.append(f"an error in the console: {message.text} ({message.location.get('url', '')})")

    def _asked(self, request: Request) -> None:
        if not request.url.startswith(LOCAL):
            self.faults.append(f"a request to another computer: {request.url}")

    def _broken(self, request: Request) -> None:
        if request.failure != LEFT:
            self.faults.append(f"a failed request: {request.url}: {request.failure}")

    def _refused(self, response: Response) -> None:
        if response.status >= 400:
            self.faults.append(f"a refused request: {response.url}: {response.status}")


@dataclass
class Workbench:
    """A server, and the browser that visits it."""

    url: str
    home: Path
    context: BrowserContext
    shots: Path

    @property
    def origin(self) -> str:
        return self.url.partition("/?")[0]

    def visit(self, path: str = "/") -> Page:
        """A new page at `path`, as one who has the token."""
        page = self.context.new_page()
        page.goto(self.origin + path)
        return page

    def shot(self, page: Page, name: str) -> None:
        """Keep a picture of the page."""
        page.screenshot(path=self.shots / f"{name}.png")

    def fits(self, page: Page) -> None:
        """Held upright, a tablet shows the whole width of the page."""
        page.set_viewport_size(TABLET)
        page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium: the system's, else the one that playwright installed. Without either the tests fail."""
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="module")
def watch() -> Watch:
    """What went wrong in the pages of a module."""
    return Watch()


@pytest.fixture(autouse=True)
def no_fault(watch: Watch) -> Iterator[None]:
    """No page may have had a fault at the end of a test."""
    yield
    faults, watch.faults = watch.faults, []
    assert faults == []


@pytest.fixture
def visitor(browser: Browser, watch: Watch) -> Iterator[Callable[[], BrowserContext]]:
    """Makes browsers without the token, for a server that the test starts itself."""
    made: list[BrowserContext] = []

    def visit() -> BrowserContext:
        made.append(watch.over(browser.new_context()))
        return made[-1]

    yield visit
    for context in made:
        context.close()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Any]]:
    """Starts `rig web` with options on a home; what it printed, and the home. All end with the module."""
    started: list[subprocess.Popen[str]] = []

    def serve(*options: str) -> tuple[dict[str, Any], Path]:
        home = tmp_path_factory.mktemp("home")
        words = [sys.executable, "-m", "rig", "web", "--json", *options]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env={**os.environ, "RIG_HOME": str(home)})
        started.append(process)
        assert process.stdout is not None
        return json.loads(process.stdout.readline()), home

    yield serve
    for process in started:
        process.send_signal(signal.SIGTERM)
    for process in started:
        assert process.wait(20) == 0
        assert process.stdout is not None
        process.stdout.close()


@pytest.fixture(scope="module")
def address(served: Callable[..., Any]) -> tuple[dict[str, Any], Path]:
    """One server for all tests of a module."""
    return served()


@pytest.fixture(scope="module")
def context(browser: Browser, watch: Watch, address: tuple[dict[str, Any], Path]) -> Iterator[BrowserContext]:
    """A browser that has the token; its pages share what they have loaded."""
    made = watch.over(browser.new_context(viewport=SIZE, accept_downloads=True))
    made.set_default_timeout(PATIENCE_MS)
    made.request.get(address[0]["url"])
    yield made
    made.close()


@pytest.fixture
def workbench(
    context: BrowserContext, address: tuple[dict[str, Any], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Workbench]:
    """The module's server, visited; the test itself has the server's record."""
    said, home = address
    monkeypatch.setenv("RIG_HOME", str(home))
    shots = Path(os.environ.get("RIG_SCREENSHOTS") or tmp_path)
    shots.mkdir(parents=True, exist_ok=True)
    yield Workbench(said["url"], home, context, shots)
    for page in context.pages:
        page.close()
