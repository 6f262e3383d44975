"""What a process of its own is to run: a procedure, or a run that goes on."""

from __future__ import annotations

import json
import secrets
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from rig.home import home

FOLDER = "apart"


@dataclass(frozen=True)
class Order:
    """`settings` are texts, as on a command line; `resume` is a run's id, or "" for a new one of `procedure`.

    `attended`: questions go to a person even where a simulated bench could answer them.
    """

    key: str
    procedure: str
    settings: Mapping[str, str] = field(default_factory=dict)
    bench_file: str = ""
    resume: str = ""
    attended: bool = False

    @property
    def bench_path(self) -> Path | None:
        """The bench file; None for the simulated rig."""
        return Path(self.bench_file) if self.bench_file else None

    def text(self) -> str:
        """For a command line."""
        return json.dumps(asdict(self))

    @staticmethod
    def read(text: str) -> Order:
        """The order that was written as `text`."""
        return Order(**json.loads(text))


def new_key() -> str:
    """A name for a process; names sort by time."""
    return f"{datetime.now(UTC):%Y%m%d-%H%M%S-%f}-{secrets.token_hex(2)}"


def file(key: str, ending: str) -> Path:
    """One of the files of a process."""
    return home() / FOLDER / f"{key}.{ending}"
