"""docs/wrong-inputs.md: the answer to each wrong input, made from the results. `python -m tests.rig.wrong_page`."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.rig.measurement_files import GOOD
from tests.rig.wrong_answers import SILENT, Answer, answer
from tests.rig.wrong_measurements import UNSEEN, WRONG

PAGE = Path(__file__).parents[2] / "docs" / "wrong-inputs.md"
TABLE = ("<!-- answers -->", "<!-- end of answers -->")
LONGEST = 150  # characters of an answer in the table


def answers(folder: Path) -> Iterator[tuple[str, str, Answer]]:
    """(kind, what is wrong, the answer) of every case; files are written to `folder`."""
    for kind, cases in WRONG.items():
        good = GOOD[kind]()
        (folder / "good.csv").write_text(good.text())
        usual = answer(folder / "good.csv", good.model)
        for name, spoil in cases.items():
            wrong = spoil(good)
            (folder / "wrong.csv").write_text(wrong.text())
            yield kind, name, answer(folder / "wrong.csv", wrong.model, usual)


def made() -> str:
    """The table, and how many inputs got each answer."""
    with tempfile.TemporaryDirectory() as folder:
        each = list(answers(Path(folder)))
        rows = [f"| {kind} | {name} | {a.kind} | {_short(a.text, folder)} |" for kind, name, a in each]
    kinds = [a.kind for *_, a in each]
    counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in sorted(set(kinds)))
    head = "| kind | what is wrong | answer | what the program says, in its first words |\n| --- | --- | --- | --- |"
    return "\n".join([f"{len(each)} inputs: {counts}.", "", head, *rows])


def unseen() -> str:
    """The table of what no data of a kind can show."""
    rows = [f"| {kind} | {name} | {why} |" for kind, cases in UNSEEN.items() for name, (_, why) in cases.items()]
    return "\n".join(["| kind | what is wrong | why the file cannot show it |", "| --- | --- | --- |", *rows])


def listed() -> dict[tuple[str, str], str]:
    """The answers in the page by kind and what is wrong."""
    text = PAGE.read_text(encoding="utf-8").partition(TABLE[0])[2].partition(TABLE[1])[0]
    found = re.findall(r"^\| (\w+) \| (.*?) \| (\w+) \| ", text, re.MULTILINE)
    return {(kind, name): said for kind, name, said in found if said != "answer"}


def _short(text: str, folder: str) -> str:
    plain = text.replace(f"{folder}/wrong.csv", "FILE").removeprefix("FILE: ").partition("\n")[0].partition(" | ")[0]
    plain = plain.replace("|", "/").replace("FILE, ", "", 1)
    return plain if len(plain) <= LONGEST else f"{plain[:LONGEST].rsplit(' ', 1)[0]} ..."


if __name__ == "__main__":
    before, rest = PAGE.read_text(encoding="utf-8").split(TABLE[0])
    result = made()
    PAGE.write_text(f"{before}{TABLE[0]}\n{result}\n{TABLE[1]}{rest.partition(TABLE[1])[2]}", encoding="utf-8")
    assert SILENT not in result, "an input passes without a word"
