"""The documentation site: built with every notebook executed, warnings as errors, and nothing from the network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path

import click
import pytest

from rig.cli import Commands
from rig.cli import rig as group
from tests.docs.markdown import ROOT

TUTORIALS = sorted(
    path for path in (ROOT / "docs" / "tutorials").glob("*.md") if "file_format: mystnb" in path.read_text("utf-8")
)
# Sockets of a kernel are on this machine; another address is refused before a packet leaves.
BUILD = """
import socket, sys
def guarded(way):
    def call(self, address):
        if self.family != socket.AF_UNIX and address[0] not in ("127.0.0.1", "::1", "localhost"):
            raise OSError(f"the site needs the network: {address}")
        return way(self, address)
    return call
socket.socket.connect, socket.socket.connect_ex = guarded(socket.socket.connect), guarded(socket.socket.connect_ex)
from sphinx.cmd.build import main
sys.exit(main(sys.argv[1:]))
"""


class Addresses(HTMLParser):
    """What a browser fetches by itself to show a page."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        loaded = given.get("src") or (tag == "link" and given.get("rel") != "canonical" and given.get("href"))
        if loaded:
            self.fetched.append(loaded)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    options = ["-W", "--keep-going", "-q", "-b", "html", "-d", str(folder / "doctrees")]
    forced = ["-D", "nb_execution_mode=force"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    built = subprocess.run(
        [sys.executable, "-c", BUILD, *options, *forced, str(ROOT / "docs"), str(folder / "html")],
        capture_output=True, text=True, env=environment, cwd=ROOT, timeout=600, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr[-8000:]
    return folder / "html"


@pytest.mark.release
def test_the_site_needs_nothing_from_the_network(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 100
    for page in pages:
        addresses = Addresses()
        addresses.feed(page.read_text("utf-8"))
        assert addresses.fetched
        assert not [address for address in addresses.fetched if re.match(r"(https?:)?//", address)], page
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*[\"']?(https?:)?//", sheet.read_text("utf-8")), sheet


@pytest.mark.release
@pytest.mark.parametrize("notebook", TUTORIALS, ids=lambda path: path.stem)
def test_notebooks_of_the_site_show_their_results(site: Path, notebook: Path) -> None:
    text = notebook.read_text("utf-8")
    cells = text.count("```{code-cell}") - text.count("remove-input")
    pictures = text.count(".plot()\n") + text.count("plt.subplots(")
    page = (site / "tutorials" / f"{notebook.stem}.html").read_text("utf-8")
    assert page.count("cell_input") >= cells > 2
    assert page.count("cell_output") >= 2
    assert page.count("<img") >= pictures
    assert "Traceback" not in page


def test_notebooks_hold_no_outputs() -> None:
    assert not list((ROOT / "docs").rglob("*.ipynb"))


@pytest.mark.parametrize("page", sorted((ROOT / "docs").rglob("*.md")), ids=lambda path: path.stem)
def test_every_page_has_one_title(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL)
    assert len(re.findall(r"^# ", text, re.MULTILINE)) == 1


def test_the_reference_has_every_command_and_option(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sphinx", reason="pip install -e '.[docs]'")
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "extensions"))
    command_reference = import_module("command_reference")
    text = "\n".join(command_reference.reference())
    context = click.Context(group)
    for name in Commands().list_commands(context):
        command = Commands().get_command(context, name)
        assert command is not None
        assert f"### rig {name}\n" in text
        hidden = {option for each in command.params if getattr(each, "hidden", False) for option in each.opts}
        options = {option for each in command.params for option in each.opts if option.startswith("--")} - hidden
        assert not [option for option in options if option not in text], name
