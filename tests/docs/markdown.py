"""What a page of documentation holds for a reader who follows it: files to write, commands to call, output to see."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NAMED = re.compile(r"^`([^`\n]+)`:\n\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?(\(\d+\))?")
RUN_ID = re.compile(r"\d{8}-\d{6}-[a-z-]+-[0-9a-f]+")


@dataclass(frozen=True)
class Commands:
    """A block of commands, and the output that the page shows below it."""

    lines: tuple[str, ...]
    shown: tuple[str, ...]


def section(page: str, title: str) -> str:
    """The text below one heading of the second level."""
    _, _, rest = (ROOT / page).read_text(encoding="utf-8").partition(f"\n## {title}\n")
    assert rest, f"{page} has no section {title!r}"
    return rest.partition("\n## ")[0]


def files(text: str) -> dict[str, str]:
    """Blocks that follow a line of the form `path`: with nothing else on it."""
    return dict(NAMED.findall(text))


def write_files(text: str, folder: Path) -> None:
    """Write each file where the page says."""
    for name, content in files(text).items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")


def commands(text: str) -> list[Commands]:
    """Blocks of `sh` in order, each with the block of `text` that follows it, if one does."""
    blocks = BLOCK.findall(text)
    found = []
    for (kind, content), (next_kind, shown) in zip(blocks, [*blocks[1:], ("", "")], strict=True):
        if kind == "sh":
            lines = tuple(line.partition("  #")[0].strip() for line in content.replace("\\\n", " ").splitlines())
            found.append(Commands(tuple(line for line in lines if line), _lines(shown) if next_kind == "text" else ()))
    return found


def gist(line: str) -> str:
    """A line without what differs from run to run: the run's id, numbers, bars, width of columns."""
    return " ".join(NUMBER.sub("0", RUN_ID.sub("RUN", line)).replace("#", "").split())


def missing(shown: tuple[str, ...], output: str) -> list[str]:
    """Lines that the page shows and `output` does not have; one that ends with " ..." is shown in part."""
    real = [gist(line) for line in output.splitlines()]
    return [line for line in shown if not any(_matches(line, other) for other in real)]


def _matches(shown: str, real: str) -> bool:
    if shown.endswith(" ..."):
        return real.startswith(gist(shown.removesuffix(" ...")))
    return gist(shown) == real


def _lines(text: str) -> tuple[str, ...]:
    return tuple(line for line in text.splitlines() if line.strip() and line.strip() != "...")
