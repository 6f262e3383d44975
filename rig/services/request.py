"""The request of an analysis: data, model, and options; and the effects that a bench file adds."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from calibrations.effects import Effect


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
        return f" --bench {shlex.quote(str(self.bench_file))}" if self.bench_file else ""


def effects_of(bench_file: Path | None) -> Mapping[str, Effect]:
    """The catalogue, with the effects in the folder that the bench file names."""
    from calibrations.effects.catalogue import catalogue

    if bench_file is None:
        return catalogue()
    from rig.bench import read_bench

    return catalogue(read_bench(bench_file).folders.effects)
