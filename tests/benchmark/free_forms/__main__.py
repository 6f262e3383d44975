"""Free forms on hidden causes: `python -m tests.benchmark.free_forms [KIND ...]`.

Options, sets and scores are those of `tests.benchmark.hidden`; with --show a wrong answer lists its places and their
sizes in noise floors.
"""

from __future__ import annotations

from pathlib import Path

import calibrations as cal
from tests.benchmark import hidden
from tests.benchmark.free_forms.adapter import measurement
from tests.benchmark.free_forms.discovery import discover


def free_forms(path: Path) -> hidden.Answer:
    """The answer of the prototype on one set."""
    _, answer = discover(measurement(cal.read(path)))
    places = ", ".join(f"{place['place']} {place['size_over_floor']:.1f}" for place in answer["places"])
    return hidden.Answer(answer["verdict"], answer["causes"], answer["alternatives"], answer["held_out"], places)


if __name__ == "__main__":
    hidden.main(free_forms, __doc__)
