"""`rig web --record URL`: pages read the lab's record; what would write says why it cannot; no password is anywhere."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Coroutine, Iterator
from contextlib import closing, contextmanager
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from nicegui import ui
from nicegui.testing import User

from rig.files import RECORD
from rig.record import Record
from rig.web.desk import Desk
from rig.web.pages import register
from tests.rig.conftest import WORD, Rig
from tests.rig.postgres import Server
from tests.rig.pushing import a_run, pushed
from tests.rig.test_web_analyses import without_browser


@pytest.fixture
def run(people: Server, database: str) -> str:
    """A run in the lab."""
    with Record() as own:
        made = a_run(own)
        pushed(own, people.url(database))
    return made


@pytest.fixture
def reader(server: Server, database: str) -> str:
    """The lab by its URL, password and all, as one who may read it."""
    return server.url(database, "anna", WORD)


@contextmanager
def served(home: Path, *words: str, **environment: str) -> Iterator[tuple[subprocess.Popen[str], Callable[[str], str]]]:
    """The server in a process of its own, and what it answers at a path to one who has its token."""
    told = {**os.environ, "RIG_HOME": str(home), **environment}
    call = [sys.executable, "-m", "rig", "web", "--json", *words]
    with subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=told) as process:
        assert process.stdout is not None
        url = urlsplit(json.loads(process.stdout.readline())["url"])

        def page(path: str) -> str:
            connection = HTTPConnection(url.netloc)
            connection.request("GET", path, headers={"Cookie": _cookie(url.netloc, url.query)})
            return connection.getresponse().read().decode()

        try:
            yield process, page
        finally:
            process.send_signal(signal.SIGTERM)


def _cookie(host: str, query: str) -> str:
    connection = HTTPConnection(host)
    connection.request("GET", f"/?{query}")
    return str(connection.getresponse().headers["Set-Cookie"]).partition(";")[0]


@pytest.mark.slow
def test_pages_read_the_lab_and_show_no_password(run: str, reader: str, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    with served(elsewhere, **{RECORD: reader}) as (process, page):
        pages = ("/record", f"/record/{run}", "/history", "/history?sensor=ADXL203", "/run", f"/?data={run}")
        answers = [page(path) for path in pages]
        assert all(run in answer for answer in answers[:2])
        assert "/history?sensor=ADXL203" in answers[2]
        assert "record: postgresql://anna:***@127.0.0.1" in answers[0]
        line = Path(f"/proc/{process.pid}/cmdline").read_bytes()
        process.send_signal(signal.SIGTERM)
        said = "".join(process.communicate(timeout=20))
    assert process.returncode == 0
    assert WORD not in "".join([*answers, said, line.decode()])
    assert not (elsewhere / "record.db").exists()


def test_a_password_in_the_words_of_a_command_is_refused(rig: Rig, reader: str) -> None:
    for command, option, variable in (
        ("runs", "--record", "RIG_RECORD"),
        ("push", "--to", "RIG_LAB"),
        ("web", "--record", "RIG_RECORD"),
    ):
        ended = rig(command, option, reader)
        assert (ended.status, ended.out) == (2, "")
        assert "PGPASSWORD" in ended.err
        assert ended.err.endswith(f" {variable}\n")
        assert WORD not in ended.err


def visiting(path: str, visit: Callable[[User], Coroutine[Any, Any, None]]) -> None:
    """Open a page without a browser, and do something there."""

    async def simulated() -> None:
        async with without_browser() as user:
            with closing(Desk(None)) as desk:
                register(desk)
                await user.open(path)
                await visit(user)

    asyncio.run(simulated())


def test_the_page_shows_the_history_in_the_laboratory(
    run: str, reader: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(RECORD, reader)
    monkeypatch.setenv("RIG_HOME", str(tmp_path / "elsewhere"))

    async def visit(user: User) -> None:
        await user.should_see(f"This model cannot use its runs: {run}", retries=200)  # noise alone: but it was read

    visiting("/history?sensor=ADXL203", visit)


def test_a_role_that_may_only_read_gets_a_message_and_writes_nothing(
    run: str, reader: str, server: Server, database: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(RECORD, reader)

    async def visit(user: User) -> None:
        await user.should_see(run)
        user.find("Note").type("a lorry").trigger("keydown.enter")
        await user.should_see("anna has no permission for this")
        await user.should_see("the owner can grant it rig_writer")
        assert WORD not in str(user.notify.messages)

    visiting(f"/record/{run}", visit)
    assert server.sql("SELECT count(*) FROM events WHERE text = 'a lorry'", database) == [(0,)]


def test_a_pose_is_excluded_in_the_lab_too(
    run: str, reader: str, server: Server, database: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the lab's record, not in that of the rig, which has a run of the same name."""
    writer = server.url(database, "rig7", WORD)
    monkeypatch.setenv(RECORD, writer)
    server.sql("UPDATE poses SET excluded = 'a lorry' WHERE number = 3", database)

    async def take_in_again(user: User) -> None:
        await user.should_see("pose 3: a lorry")
        user.find(kind=ui.button, content="Include again").click()
        for _ in range(100):
            if not server.sql("SELECT 1 FROM poses WHERE excluded IS NOT NULL", database):
                return
            await asyncio.sleep(0.02)

    visiting(f"/record/{run}", take_in_again)
    assert server.sql("SELECT count(*) FROM poses WHERE excluded IS NOT NULL", database) == [(0,)]
    with Record() as own:
        assert own.events(run)[-1].what != "pose 3 included"
