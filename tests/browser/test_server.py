"""Where the workbench listens, what it says of it, and how it ends."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from select import select
from typing import Any
from urllib.parse import quote

import pytest
from playwright.sync_api import BrowserContext, expect

from rig.web.server import RETURN_S
from tests.browser.conftest import PATIENCE_MS, Watch, Workbench
from tests.browser.held import held_up
from tests.browser.measured import thousand

pytestmark = pytest.mark.slow

WEB = [sys.executable, "-m", "rig", "web", "--no-open"]


@contextmanager
def started(home: Path, *words: str) -> Iterator[dict[str, Any]]:
    """A server with its record in `home`, by its document; it ends with the context."""
    environment = {**os.environ, "RIG_HOME": str(home)}
    with subprocess.Popen([*WEB, "--json", *words], stdout=subprocess.PIPE, text=True, env=environment) as server:
        assert server.stdout is not None
        try:
            yield json.loads(server.stdout.readline())
        finally:
            server.terminate()


def test_a_port_that_is_taken_is_refused() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        words = [*WEB, "--port", str(port)]
        ended = subprocess.run(words, check=False, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 2
    assert f"cannot listen at 127.0.0.1:{port}: Address already in use; give another --port" in ended.stderr


def test_another_host_gives_a_warning_and_needs_a_token() -> None:
    words = [*WEB, "--json", "--host", "127.0.0.2"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        assert server.stderr is not None
        said = json.loads(server.stdout.readline())
        assert said["url"].startswith(f"http://127.0.0.2:{said['port']}/?token=")
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(f"http://127.0.0.2:{said['port']}/")
        assert refused.value.code == 401
        refused.value.close()
        server.terminate()
        assert server.wait(20) == 0
        assert "Listening at 127.0.0.2: other machines can reach the workbench" in server.stderr.read()


def test_a_wrong_token_is_refused_in_the_browser(
    visitor: Callable[[], BrowserContext], watch: Watch, workbench: Workbench
) -> None:
    page = visitor().new_page()
    answer = page.goto(f"{workbench.origin}/?token=wrong")
    assert answer is not None
    assert answer.status == 401
    assert "Open the address that `rig web` printed" in page.inner_text("body")
    watch.expects("a refused request")
    watch.expects("status of 401")


@pytest.mark.parametrize(
    ("path", "shown"),
    [
        ("/?data={}", 'role=button[name="Cancel"]'),
        ("/run?procedure=misalignment&most_rounds=3000&target_deg=1e-12", "text=Planning; nothing moves"),
    ],
)
def test_a_server_that_ends_does_not_wait_for_a_calculation(
    path: str, shown: str, visitor: Callable[[], BrowserContext], tmp_path: Path
) -> None:
    words, home = (
        [*WEB, "--json", "--bench", str(held_up(tmp_path))],
        {**os.environ, "RIG_HOME": str(tmp_path / "home")},
    )
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=home) as server:
        try:
            assert server.stdout is not None
            page = visitor().new_page()
            url = json.loads(server.stdout.readline())["url"]
            page.goto(url)
            page.goto(url.partition("/?")[0] + path.format(quote(thousand(tmp_path))))
            expect(page.locator(shown)).to_be_visible()
            page.wait_for_load_state("networkidle")  # else a file that is being sent breaks off, a fault of the page
            server.terminate()
            assert server.wait(2) == 0
            page.context.close()
        finally:
            server.kill()


@pytest.mark.parametrize("closed", [True, False])
def test_a_closed_page_ends_its_computation(
    closed: bool, served: Callable[..., Any], visitor: Callable[[], BrowserContext], tmp_path: Path
) -> None:
    begun, ended = (_pipe(tmp_path / name) for name in ("begun", "ended"))
    said, _ = served("--bench", str(held_up(tmp_path)))
    page = visitor().new_page()
    page.goto(said["url"])
    page.goto(f"{said['url'].partition('/?')[0]}/?data={quote(thousand(tmp_path))}")
    assert select([begun], [], [], PATIENCE_MS / 1000)[0]
    assert not select([ended], [], [], 0)[0]
    if closed:
        page.close()
    else:
        page.get_by_role("link", name="Record").click()
    assert select([ended], [], [], RETURN_S / 2)[0]
    for pipe in (begun, ended):
        os.close(pipe)


def _pipe(path: Path) -> int:
    """A named pipe, opened for reading; nobody waits for the other."""
    os.mkfifo(path)
    return os.open(path, os.O_RDONLY | os.O_NONBLOCK)


def test_a_page_reports_a_lost_server_and_connects_again(
    visitor: Callable[[], BrowserContext], watch: Watch, tmp_path: Path
) -> None:
    with started(tmp_path) as said:
        page = visitor().new_page()
        page.goto(said["url"])
        page.get_by_role("link", name="Run").click()
        expect(page.get_by_text("Takes", exact=True)).to_be_visible()
        lost = page.get_by_text("The workbench does not answer")
        expect(lost).to_be_hidden()
    expect(lost).to_be_visible()
    page.get_by_label("step (deg)").fill("90")
    page.get_by_label("step (deg)").press("F8")
    page.get_by_role("button", name="Start").click()
    box = page.locator("#popup").bounding_box()
    assert box is not None
    assert 0 < box["y"] < 100  # where the eye is, and no button of the head is covered
    with started(tmp_path, "--port", str(said["port"])):
        expect(lost).to_be_hidden()
        expect(page).to_have_url(re.compile("step_deg=90"))  # what was typed meanwhile counts
        expect(page.get_by_label("step (deg)")).to_have_value("90")
        page.context.close()
    watch.expects("")  # requests that no server answered


def test_text_in_an_open_dialog_stays_after_a_restart_of_the_server(
    visitor: Callable[[], BrowserContext], watch: Watch, tmp_path: Path
) -> None:
    with started(tmp_path) as said:
        page = visitor().new_page()
        page.goto(said["url"])
        page.get_by_role("link", name="Run").click()
        expect(page.get_by_role("button", name="Start")).to_be_enabled()
        page.get_by_role("button", name="Start").click()
        page.get_by_role("dialog").get_by_label("Serial number").fill("17")
    expect(page.get_by_text("The workbench does not answer")).to_be_visible()
    with started(tmp_path, "--port", str(said["port"])):
        kept = page.get_by_text("again: your text is kept")
        expect(kept).to_be_visible()
        expect(page.get_by_role("dialog")).to_have_count(0)  # no script presses Start
        page.get_by_role("button", name="Start").click()
        expect(page.get_by_role("dialog").get_by_label("Serial number")).to_have_value("17")
        expect(kept).to_have_count(0)
        page.context.close()
    watch.expects("")  # requests that no server answered


def test_a_click_while_the_connection_is_lost_does_nothing_later(workbench: Workbench) -> None:
    """The browser would send it when the connection is back, and a run would begin when nobody expects it."""
    page = workbench.visit("/run")
    expect(page.get_by_text("Takes", exact=True)).to_be_visible()
    page.evaluate("socket.disconnect()")
    expect(page.get_by_text("The workbench does not answer")).to_be_visible()
    page.get_by_role("button", name="Start").click()
    page.get_by_label("step (deg)").fill("45")
    page.evaluate("socket.connect()")
    expect(page.get_by_text("The workbench does not answer")).to_be_hidden()
    expect(page).to_have_url(re.compile("step_deg=45"))
    expect(page.get_by_role("dialog")).to_have_count(0)
    page.get_by_role("button", name="Start").click()
    expect(page.get_by_role("dialog")).to_be_visible()


def test_the_address_is_valid_after_a_restart_until_a_new_token_is_requested() -> None:
    said = []
    for options in ((), (), ("--new-token",)):
        words = [*WEB, "--json", *options]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as server:
            assert server.stdout is not None
            said.append(json.loads(server.stdout.readline())["url"].partition("token=")[2])
            server.terminate()
            assert server.wait(20) == 0
    assert said[0] == said[1] != said[2]
