"""A real browser on a real server: `rig web` in a process of its own, Chromium driven by playwright.

Every page is watched: an error in it, or a request to anywhere but the server, fails the test. RIG_SCREENSHOTS names a
folder in which the pictures that tests take are kept.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

SIZE = {"width": 1280, "height": 720}
TABLET = {"width": 768, "height": 1024}
PATIENCE_MS = 30_000
TOO_LATE = "Resize must be passed a displayed plot"  # NiceGUI resizes a picture that was just taken away
expect.set_options(timeout=PATIENCE_MS)


@dataclass
class Workbench:
    """A server, and the browser that visits it."""

    url: str
    home: Path
    context: BrowserContext
    shots: Path
    faults: list[str] = field(default_factory=list)

    @property
    def origin(self) -> str:
        return self.url.partition("/?")[0]

    def visit(self, path: str = "/") -> Page:
        """A new page at `path`, as one who has the token."""
        page = self.context.new_page()
        page.on("pageerror", lambda error: str(error).startswith(TOO_LATE) or self.faults.append(str(error)))
        page.on("request", lambda request: self._look(request.url))
        page.goto(self.origin + path)
        return page

    def shot(self, page: Page, name: str) -> None:
        """Keep a picture of the page."""
        page.screenshot(path=self.shots / f"{name}.png")

    def fits(self, page: Page) -> None:
        """Held upright, a tablet shows the whole width of the page."""
        page.set_viewport_size(TABLET)
        page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")

    def _look(self, url: str) -> None:
        if not url.startswith((self.origin, self.origin.replace("http", "ws"), "data:", "blob:")):
            self.faults.append(f"asked for {url}")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium: the system's, else the one that playwright installed. Without either the tests fail."""
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        yield started
        started.close()


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
def context(browser: Browser, address: tuple[dict[str, Any], Path]) -> Iterator[BrowserContext]:
    """A browser that has the token; its pages share what they have loaded."""
    made = browser.new_context(viewport=SIZE, accept_downloads=True)
    made.set_default_timeout(PATIENCE_MS)
    made.request.get(address[0]["url"])
    yield made
    made.close()


@pytest.fixture
def workbench(
    context: BrowserContext, address: tuple[dict[str, Any], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Workbench]:
    """The module's server, visited; the test itself has the server's record. No page may have had a fault."""
    said, home = address
    monkeypatch.setenv("RIG_HOME", str(home))
    shots = Path(os.environ.get("RIG_SCREENSHOTS") or tmp_path)
    shots.mkdir(parents=True, exist_ok=True)
    bench = Workbench(said["url"], home, context, shots)
    yield bench
    for page in context.pages:
        page.close()
    assert bench.faults == []
