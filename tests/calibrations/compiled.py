"""A written compensation on a compiler's terms: no warning, and rows of numbers through its function."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from calibrations.compensation import sources
from calibrations.compensation.document import Origin, make_vectors
from calibrations.compensation.inverse import Compensation
from calibrations.table import Array

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-Wdouble-promotion", "-O2")
ORIGIN = Origin("sensor", "sensor.yaml", "0" * 64, "a program", "2026-01-01")
COMPILERS = [
    pytest.param(name, marks=[pytest.mark.skipif(shutil.which(name) is None, reason=f"{name} is not installed"), *more])
    for name, more in (("gcc", []), ("clang", [pytest.mark.slow]))
]
DRIVER = """#include "sensor.h"
#include <stdio.h>
int main(void)
{
    sensor_input in;
    while (fread(&in, sizeof in, 1, stdin) == 1) {
        const sensor_output out = sensor_compensate(&in);
        if (fwrite(&out, sizeof out, 1, stdout) != 1) return 1;
    }
    return 0;
}
"""
FOLLOWING = DRIVER.replace("sensor_input in;", "sensor_input in;\n    sensor_memory memory = {0};").replace(
    "compensate(&in)", "compensate(&in, &memory)"
)


def written(made: Compensation, folder: Path, origin: Origin = ORIGIN) -> list[Path]:
    """The C files, and what they are made of; the header is among them."""
    files: Mapping[str, str] = sources.c_files(made, origin, make_vectors(made))
    for name, text in files.items():
        (folder / name).write_text(text)
    return [folder / name for name in files]


def build(compiler: str, sources: Sequence[Path], out: Path, *options: str) -> Path:
    """The program that `sources` make, without a warning."""
    c = [str(path) for path in sources if path.suffix == ".c"]
    done = subprocess.run(
        [compiler, *STRICT, *options, *c, "-lm", "-o", str(out)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return out


def through(program: Path, inputs: Array, outputs: int, precision: str = "double") -> Array:
    """What the driver's program makes of rows of inputs."""
    kind = {"double": np.float64, "float": np.float32}[precision]
    done = subprocess.run(
        [str(program)], input=np.ascontiguousarray(inputs, kind).tobytes(), capture_output=True, check=True
    )
    return np.frombuffer(done.stdout, kind).reshape(len(inputs), outputs).astype(np.float64)
