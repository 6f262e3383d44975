"""Coverage-guided fuzzing of one target by Atheris: `python -m tests.benchmark.guided TARGET [SECONDS]`.

Inputs that reach new code are kept and changed further, so that it finds its way behind a check that random changes do
not pass. It works on the same targets as tests.benchmark.fuzz; an error that is not documented ends it with a traceback
and the input. `pip install -e '.[bench]'` has Atheris. Behind gcs-request is compiled physics: it cannot be guided.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import atheris

# by numba, which does not know what Atheris adds
COMPILED = ["drivers.world", "calibrations.effects.kernels", "calibrations.means.kernels"]

with atheris.instrument_imports(include=["calibrations", "drivers", "rig", "pymodbus", "yaml"], exclude=COMPILED):
    from tests.fuzz.files import remove
    from tests.fuzz.targets import TARGETS

LONGEST = 4096  # bytes of an input


def main(name: str, seconds: str = "60") -> None:
    target = TARGETS[name]

    def take(data: bytes) -> None:
        try:
            target.take(data)
        except target.errors:
            return

    with tempfile.TemporaryDirectory() as corpus:
        for number, seed in enumerate(target.seeds):
            (Path(corpus) / str(number)).write_bytes(seed)
        words = [
            sys.argv[0],
            corpus,
            f"-max_total_time={seconds}",
            f"-max_len={LONGEST}",
            "-timeout=10",
            "-rss_limit_mb=4096",
        ]
        atheris.Setup(words, take)
        atheris.Fuzz()
    remove()


if __name__ == "__main__":
    main(*sys.argv[1:])
