"""What an analysis is asked: which data, beside which model, with what is known beside them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Request:
    """A question of the command line or the workbench, in the words it was put in.

    `data` is a file or a run; `model` a shipped model's name or a file, None for that of the kind of data. `noise` is a
    model of the sensor's noise, which then is not guessed. `channel` and `rate_hz` are of a still record alone.
    """

    data: str
    model: str | None = None
    bench_file: Path | None = None
    noise: str | None = None
    channel: str | None = None
    rate_hz: float | None = None

    @property
    def bench_words(self) -> str:
        """What names the bench in a command that is proposed, with a space before it; nothing for the simulated rig."""
        return f" --bench {self.bench_file}" if self.bench_file else ""
