"""What a compensation in C takes: nanoseconds a sample and bytes of code, by model, precision and compiler."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from calibrations.compensation.inverse import invert_model
from tests.calibrations.compiled import build, written
from tests.calibrations.fitted import LINEAR, PHYSICAL, model
from tests.calibrations.test_compensation import EVERYTHING

SLIPS = {"hysteresis": {"height": (0.003, 0.002), "reach": 0.1, "spread": 0.5, "pressing": 0.4}}
MODELS = {
    "linear": LINEAR,
    "physical": PHYSICAL,
    "every effect that bends": EVERYTHING,
    "linear with hysteresis": LINEAR | SLIPS,
    "physical with hysteresis": PHYSICAL | SLIPS,
}
SAMPLES, REPEATS = 1_000_000, 5
TIMER = f"""#define _POSIX_C_SOURCE 199309L
#include "sensor.h"
#include <stdio.h>
#include <time.h>
int main(void)
{{
    static sensor_input in[256];
    double best = 1e9;
    volatile sensor_real sink = 0;
    int repeat, i;
    for (i = 0; i < 256; ++i) in[i].vx = (sensor_real)(2.0 + i / 256.0), in[i].vy = (sensor_real)(3.0 - i / 256.0);
    for (repeat = 0; repeat < {REPEATS}; ++repeat) {{
        struct timespec a, b;
        double ns;
        clock_gettime(CLOCK_MONOTONIC, &a);
        for (i = 0; i < {SAMPLES}; ++i) sink = sensor_compensate(&in[i & 255]).ax;
        clock_gettime(CLOCK_MONOTONIC, &b);
        ns = 1e9 * (double)(b.tv_sec - a.tv_sec) + (double)(b.tv_nsec - a.tv_nsec);
        if (ns < best) best = ns;
    }}
    printf("%f\\n", best / {SAMPLES});
    return sink != sink;
}}
"""


def main() -> None:
    found = {
        f"{name}, {precision}, {compiler}": _measured(values, precision, compiler)
        for name, values in MODELS.items()
        for precision in ("double", "float")
        for compiler in filter(shutil.which, ("gcc", "clang"))
    }
    print(json.dumps(found))


def _measured(values: Any, precision: str, compiler: str) -> dict[str, Any]:
    made = invert_model(model(values), precision=precision)
    with TemporaryDirectory() as name:
        folder = Path(name)
        sources = [path for path in written(made, folder) if "self_test" not in path.name]
        remembering = TIMER.replace("static sensor_input", "sensor_memory memory = {0};\n    static sensor_input")
        remembering = remembering.replace("&in[i & 255])", "&in[i & 255], &memory)")
        (folder / "timer.c").write_text(remembering if made.forward.memory else TIMER)
        timer = build(compiler, [*sources, folder / "timer.c"], folder / "timer")
        ns = float(subprocess.run([str(timer)], capture_output=True, text=True, check=True).stdout)
        return {"ns": round(ns, 1), "code_bytes": _code_bytes(compiler, folder), "steps": made.bound.steps,
                "operations": sum(made.program.operations.values())}  # fmt: skip


def _code_bytes(compiler: str, folder: Path) -> int:
    """Of the function alone, made small."""
    subprocess.run([compiler, "-std=c99", "-Os", "-c", "sensor.c", "-o", "sensor.o"], cwd=folder, check=True)
    said = subprocess.run(["nm", "-S", "sensor.o"], cwd=folder, capture_output=True, text=True, check=True).stdout
    found = re.search(r"^\w+ (\w+) T sensor_compensate$", said, re.MULTILINE)
    return int(found[1], 16) if found else 0


if __name__ == "__main__":
    main()
