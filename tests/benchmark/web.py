"""`python -m tests.benchmark.web`: the figures of the workbench in a real browser, one JSON document with targets.

first page   from the address of a server that has just started to the page that a newcomer reads, in an open window
pictures     from the address of a sweep of the default rig, 518 poses, to its pictures, the first on this server
verdict      from the same address to the first verdict, which is provisional
again        from the same address to the final verdict, the search being known
report       from the address of the run to its report, the search being known
start        from the click on Start, as the page receives it, to the checklist
add          from the click on Add to the second bar of the falling error and the new residual, on 518 poses
night        from the address of a 12-hour soak (43.2 million samples of one channel) to its curve
alive        from a key to its answer, the longest of some while effects are tried on 1,000 poses, and on 100,000 rows
memory       of server and page, while an hour of a soak is measured and watched

A person reads a page before the next click. So each figure but the first begins when server and browser have
nothing to do.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

import numpy as np
from playwright.sync_api import Browser, Page, expect, sync_playwright

from drivers.recorder import Samples
from procedures.catalogue import find
from procedures.session import Pose
from rig.bench import read_bench
from rig.cli.terminal.watch import Quiet
from rig.record import KeptPose, Record
from rig.runs.runner import start
from tests.browser.measured import hidden, hundred_thousand, thousand
from tests.browser.test_run_page import begin

TARGETS = {
    "first_page_s": 1.0,
    "pictures_s": 1.0,
    "verdict_s": 2.0,
    "again_s": 2.0,
    "report_s": 3.0,
    "start_s": 0.3,
    "add_s": 1.0,
    "night_s": 1.0,
    "alive_s": 0.5,
    "memory_growth_mb": 16.0,
}
BLOCKS, IN_A_BLOCK, RATE_HZ = 4320, 10_000, 1000.0
STEP_V = 20.0 / 65536
DOTS = "[aria-label='Residuals'] .points path"
VERDICT = ".verdict.bad, .verdict.doubt, .verdict.good"
CARD = ".side .card"
BARS = "[aria-label*=' by model'] .bars .point"
CURVE = "[aria-label='the run over time'] .scatterlayer path"
SHOWN_SINCE = """() => {
  const begin = [...document.querySelectorAll(".begin button")].find(button => button.textContent.includes("Begin"));
  return begin?.checkVisibility() && performance.now() - clicked;
}"""
REPEATS = 3
RESTING = 10  # hundredths of a second of processor time in a second: less is no calculation
PATIENCE_MS = 120_000
expect.set_options(timeout=PATIENCE_MS)


def main() -> None:
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        os.environ["RIG_HOME"] = str(Path(folder) / "home")
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"),
            args=["--no-sandbox", "--js-flags=--expose-gc", "--enable-precise-memory-info"],
        )
        browser.new_page().goto("about:blank")
        figures = {"first_page_s": min(_first_page(browser) for _ in range(REPEATS))}
        with _served() as (url, _), browser.new_page() as page:
            figures |= _sweep(page, url)
        with _served() as (url, server):
            page, origin = browser.new_page(), url.partition("/?")[0]
            page.set_default_timeout(PATIENCE_MS)
            page.goto(url)
            figures["start_s"] = _start(page, origin)
            figures["add_s"] = _add(page, origin, hidden(Path(folder), "package turned"))
            figures["alive_s"] = max(_alive(page, origin, make(Path(folder))) for make in (thousand, hundred_thousand))
            night = f"{origin}/record/{_night()}"
            figures["night_s"] = min(_timed(page, night, CURVE) for _ in range(REPEATS))
            figures |= _memory(page, origin, server)
        browser.close()
    met = {name: figures[name] <= target for name, target in TARGETS.items()}
    load = {"load": os.getloadavg()[0], "cores": os.cpu_count()}
    json.dump(
        {"schema": "rig.benchmark/1", **load, "figures": figures, "targets": TARGETS, "met": met}, sys.stdout, indent=1
    )
    print()


@contextmanager
def _served() -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A server: the address that it printed, and its process."""
    server = subprocess.Popen([sys.executable, "-m", "rig", "web", "--json"], stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    yield json.loads(server.stdout.readline())["url"], server
    server.send_signal(signal.SIGTERM)
    server.wait()


def _first_page(browser: Browser) -> float:
    with browser.new_page() as page:
        _rest()
        with _served() as (url, _):
            return _timed(page, url, "text=There are no measurements yet")


def _rest() -> None:
    """Wait until the server, the process that draws for it, and the browser compute no more."""
    before = -RESTING
    while (present := _ticks(os.getpid())) - before >= RESTING:
        before = present
        time.sleep(1)


def _ticks(pid: int) -> int:
    """Processor time of a process and of those that it started, in hundredths of a second."""
    children = [
        int(child) for task in Path(f"/proc/{pid}/task").iterdir() for child in _read(task / "children").split()
    ]
    own = _read(Path(f"/proc/{pid}/stat")).rpartition(")")[2].split()[11:13]
    return sum(map(int, own)) + sum(map(_ticks, children))


def _read(file: Path) -> str:
    """A file of /proc; "" if its process has ended."""
    try:
        return file.read_text(encoding="utf-8")
    except (FileNotFoundError, ProcessLookupError):
        return ""


def _sweep(page: Page, url: str) -> dict[str, float]:
    """The pages on a sweep: first pictures, first verdict, verdict of the page that is opened again, report."""
    with Record() as record:
        run = start(record, read_bench(), find("sweep"), {}, Quiet({})).run.run
    page.set_default_timeout(PATIENCE_MS)
    page.goto(url)
    origin = url.partition("/?")[0]
    model = f"{origin}/?data={run}"
    _rest()
    began = time.perf_counter()
    figures = {"pictures_s": _timed(page, model, DOTS)}
    page.locator(VERDICT).wait_for()
    figures["verdict_s"] = time.perf_counter() - began
    page.locator(CARD).first.wait_for()
    _rest()
    figures["again_s"] = _timed(page, model, CARD)
    _rest()
    figures["report_s"] = _timed(page, f"{origin}/record/{run}", ".report iframe")
    return figures


def _start(page: Page, origin: str) -> float:
    page.goto(f"{origin}/run?procedure=soak&duration_s=3600&off_s=0")
    expect(page.get_by_text("Takes", exact=True)).to_be_visible()
    _rest()
    page.evaluate("addEventListener('click', () => { clicked = performance.now(); }, {capture: true, once: true})")
    page.get_by_role("button", name="Start").click()
    shown = page.wait_for_function(SHOWN_SINCE, timeout=PATIENCE_MS)  # in the page: Playwright looks ten times a second
    return float(shown.json_value()) / 1000


def _add(page: Page, origin: str, data: str) -> float:
    page.goto(f"{origin}/?data={quote(data)}")
    add = page.get_by_role("button", name="Add axis-misalignment")
    expect(add).to_be_enabled()
    page.get_by_text("axis-misalignment", exact=True).nth(1).wait_for()
    _rest()
    began = time.perf_counter()
    add.click()
    expect(page.locator(BARS)).to_have_count(2)
    return time.perf_counter() - began


def _alive(page: Page, origin: str, data: str) -> float:
    page.goto(f"{origin}/?data={quote(data)}")
    cancel = page.get_by_role("button", name="Cancel")
    cancel.wait_for()
    waits = [0.0]
    while cancel.is_visible():
        began = time.perf_counter()
        page.keyboard.press("?")
        page.get_by_role("dialog").first.wait_for()
        waits.append(time.perf_counter() - began)
        page.keyboard.press("Escape")
        expect(page.get_by_role("dialog")).to_have_count(0)
    return max(waits)


def _night() -> str:
    """Twelve hours of blocks in the record, as a soak keeps them; the run."""
    rng = np.random.default_rng(1)
    about: dict[str, Any] = {"bench": {"seed": 1}, "identities": {}, "configuration": "", "constants": {}, "source": ""}
    with Record() as record:
        run = record.begin("soak", {"oven_c": 0.0}, kind="still", **about)
        for number in range(BLOCKS):
            drift = 2.5 + 0.01 * np.exp(-number / 900)
            volts = np.round((drift + 8e-4 * rng.standard_normal((IN_A_BLOCK, 1))) / STEP_V) * STEP_V
            block = Samples(volts, ("vx",), RATE_HZ, 10.0 * number)
            record.keep(run, number, KeptPose(Pose(0, 0, 0, f"hold {number}"), block, 10.0 * number, 22.0), None)
        record.set_state(run, "complete")
    return run


def _timed(page: Page, url: str, until: str) -> float:
    began = time.perf_counter()
    page.goto(url)
    page.locator(until).first.wait_for()
    return time.perf_counter() - began


def _memory(page: Page, origin: str, server: subprocess.Popen[str]) -> dict[str, float]:
    """Memory in MB when a tenth of the hour is measured, and at its end."""
    page.goto(f"{origin}/run?procedure=soak&duration_s=3600&off_s=0")
    expect(page.get_by_text("Takes", exact=True)).to_be_visible()
    begin(page)
    page.locator(CURVE).first.wait_for()
    before = _used_mb(page, server.pid)
    expect(page.locator(".chip").first).to_have_text("complete")
    after = _used_mb(page, server.pid)
    growth = max(after[name] - before[name] for name in after)
    return {f"{name}_mb": round(value, 1) for name, value in after.items()} | {"memory_growth_mb": round(growth, 1)}


def _used_mb(page: Page, server: int) -> dict[str, float]:
    page.evaluate("() => { gc(); gc(); }")
    heap = float(page.evaluate("() => performance.memory.usedJSHeapSize"))
    status = Path(f"/proc/{server}/status").read_text(encoding="utf-8")
    resident = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    return {"page": heap / 1e6, "server": int(resident.split()[1]) / 1e3}


if __name__ == "__main__":
    main()
