"""Dependencies: each has a range with two ends, and a version within it that the tests pass with."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
ASKED = [*PROJECT["dependencies"], *(each for extra in PROJECT["optional-dependencies"].values() for each in extra)]
PINNED = {
    re.sub(r"[-_.]+", "-", name).lower(): version
    for name, version in re.findall(r"^([\w.-]+)==([\w.]+)$", (ROOT / "constraints.txt").read_text(), re.MULTILINE)
}


def numbers(version: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d+", version)]


@pytest.mark.parametrize("asked", ASKED, ids=lambda asked: re.match(r"[\w-]+", asked)[0])
def test_a_dependency_has_a_range_and_a_version_in_it(asked: str) -> None:
    told = re.fullmatch(r"([\w-]+)(?:\[\w+\])?(?:~=([\d.]+)|>=([\d.]+),<([\d.]+))", asked)
    assert told, "write it as name>=lowest,<first-that-is-not-known or name~=lowest"
    name, compatible, least, beyond = told.groups()
    version = numbers(PINNED[name])
    assert version >= numbers(compatible or least)
    assert version < numbers(beyond) if beyond else version[:1] == numbers(compatible)[:1]
