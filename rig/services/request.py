"""The request of an analysis: data, model, and options."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Request:
    """A request of the command line or the workbench, as texts.

    `data` is a file or a run; `model` the name of a shipped model or a file, None for the default of the kind of data.
    `noise` is a noise model of the sensor. `channel` and `rate_hz` are for still records.
    """

    data: str
    model: str | None = None
    bench_file: Path | None = None
    noise: str | None = None
    channel: str | None = None
    rate_hz: float | None = None

    @property
    def bench_words(self) -> str:
        """The option --bench for a proposed command, with a space before it; empty for the simulated rig."""
        return f" --bench {self.bench_file}" if self.bench_file else ""
