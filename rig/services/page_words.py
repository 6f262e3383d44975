"""Messages of the command line as a page shows them: what a command does there, a button opens here."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlencode

MODEL, RECORD, RUN, HISTORY, IMPORT = "Model", "Record", "Run", "History", "Import"
PAGES = {  # command: the page that does the same; a command that is not here stays in the text
    **dict.fromkeys(("add", "certificate", "compare", "compensate", "diagnose", "discover", "exclude", "fit"), MODEL),
    **dict.fromkeys(("models", "noise"), MODEL),
    **dict.fromkeys(("report", "runs", "show"), RECORD),
    **dict.fromkeys(("resume", "run"), RUN),
    **dict.fromkeys(("control", "history"), HISTORY),
    "import": IMPORT,
}
COMMAND = rf"rig (?P<command>{'|'.join(sorted(PAGES, key=len, reverse=True))})\b"
WORDS = r"(?: (?P<procedure>level-check|check-standard|noise-floor|soak|sweep)\b)?"
OPTIONS = r"(?P<options>(?: --[\w-]+(?: [\w.]+)?)*)"
BLOCK = re.compile(rf"[:\s]*\n+ {{4}}{COMMAND}[^\n]*\n*")  # a line of its own, to copy
QUOTED_COMMAND = re.compile(rf"`{COMMAND}{WORDS}(?P<options>[^`]*)`")
BARE = re.compile(rf"(?<!the )(?<!a ){COMMAND}{WORDS}{OPTIONS}")
LONGER = re.compile(r" \(--([\w-]+) ([\d.e+]+)\)")
OPTION_WORDS = (  # options of commands in messages, as the fields of their pages
    (re.compile(r"import it with(?= \(the page)"), "import it"),
    (re.compile(r"with --column, (?:by its number, )?such as \S+"), "on the page Import"),
    (re.compile(r"--column (\w+)=[^\s:]*:([\w/]+)"), r"\2 as the unit of \1"),
    (re.compile(r"with --topic(?=:)"), "at Table of the file"),
    (re.compile(r"give the file of that bench with --bench"), "choose that bench under Measure on, page Run"),
    (re.compile(r"; --bad-lines skip skips them"), ""),
    (re.compile(r"--constant (\w+)=([^\s);,]+)"), r"the constant \1 = \2"),
    (
        re.compile(r"a line such as `# sample_rate_hz: \S+` above its header \(in the page Import, [^)]*\)"),
        'the field "Sample rate (Hz)" of the page Import',
    ),
)


@dataclass(frozen=True)
class PageStep:
    """A sentence without commands, and the addresses that replace them by the labels of their buttons."""

    text: str
    to: Mapping[str, str]


def page_step(line: str, data: str = "", procedure: str = "") -> PageStep:
    """A message for a page. `data` is the run or file that it is about, `procedure` that of the run."""
    addresses: dict[str, str] = {}

    def opened(match: re.Match[str]) -> str:
        groups = match.groupdict()
        if groups.get("procedure") and groups["command"] == RUN.lower():
            addresses[f"Measure {groups['procedure']}"] = f"/run?procedure={groups['procedure']}"
            return f"the procedure {groups['procedure']}"
        page = MODEL if "--poses" in (groups.get("options") or "") else PAGES[groups["command"]]
        addresses[page] = address(page, data)
        return f"the page {page}"

    if longer := LONGER.search(line):
        settings = {"procedure": procedure, longer[1].replace("-", "_"): longer[2]}
        addresses["Measure longer"] = f"/run?{urlencode(settings)}"
    text = LONGER.sub("", line)
    text = BLOCK.sub(lambda match: f" ({opened(match)}).\n", text)
    for pattern in (QUOTED_COMMAND, BARE):
        text = pattern.sub(opened, text)
    for pattern, words in OPTION_WORDS:
        text = pattern.sub(words, text)
    return PageStep(text.rstrip("\n"), addresses)


def address(page: str, data: str) -> str:
    """The address of a page, for data if they are known."""
    if page == RECORD:
        return f"/record/{data.partition('/')[0]}" if data and not re.search(r"[\\.]", data) else "/record"
    if page == RUN:
        return "/run"
    if page == HISTORY:
        return "/history"
    path, name = ("/import", "file") if page == IMPORT else ("/", "data")
    return f"{path}?{urlencode({name: data})}" if data else path
