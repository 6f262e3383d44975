"""The search for places on hidden causes: `python -m tests.benchmark.places [KIND ...]`.

Options, sets and scores are those of `tests.benchmark.hidden`; with --show a wrong answer lists its places and their
sizes in noise floors.
"""

from __future__ import annotations

from pathlib import Path

import calibrations as cal
from calibrations.effects.catalogue import catalogue
from calibrations.loop import dataset
from calibrations.model.file import read_model
from tests.benchmark import hidden


def by_places(path: Path) -> hidden.Answer:
    """The answer of `rig discover --places`, in this process."""
    result = dataset(cal.read(path)).discover_places(read_model("linear"), catalogue())
    places = ", ".join(f"{place.name} {place.size:.1f}" for place in result.findings.places)
    return hidden.Answer(str(result.verdict), result.causes, result.alternatives, result.end.held_out_excess, places)


if __name__ == "__main__":
    hidden.main(by_places, __doc__)
