"""A search that goes on for as long as a test wants."""

from pathlib import Path

import yaml

from rig.bench import DEFAULT

HELD_UP = '''import time
from pathlib import Path

from calibrations.effects import Effect, Parameter


class HeldUp(Effect):
    """held-up: a parabola that takes long to compute.

        V += k a_i^2

    Symptom   none.
    Excited by  anything.
    Source    none.
    """

    square = Parameter("{{out}}/g^2", typical=0.02, doc="of the square")

    def transduction(self, a, table, p):
        Path("{begun}").write_text("begun")
        try:
            while not Path("{go}").exists():
                time.sleep(0.01)
        finally:
            Path("{ended}").write_text("ended")
        return a**2 * p.square
'''


def held_up(folder: Path) -> Path:
    """A bench with an effect of its own that no search gets past before the file "go" is there.

    The files "begun" and "ended" are written when the effect is computed, and when that ends, also by a cancellation.
    """
    (folder / "effects").mkdir()
    files = {name: folder / name for name in ("begun", "go", "ended")}
    (folder / "effects" / "held_up.py").write_text(HELD_UP.format(**files))
    given = yaml.safe_load(DEFAULT.read_text()) | {"folders": {"effects": "effects"}}
    (bench := folder / "bench.yaml").write_text(yaml.safe_dump(given))
    return bench
