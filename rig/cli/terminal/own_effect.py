"""What is left of a residual as an effect of one's own: the command that adds it to the model."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from calibrations.discovery.patterns import Pattern
from rig.services.request import Request


def own_effect(pattern: Pattern | None, model: str, request: Request) -> dict[str, Any] | None:
    """The pattern as `expression`, `name`, and the `command` that adds it to `model`; None where it cannot be one."""
    if pattern is None or not pattern.expression:
        return None
    words = ["rig", "add", pattern.expression, "--name", pattern.name, "--model", model, "--data", request.data]
    words += ["--out", f"{pattern.name}.yaml", *(["--bench", str(request.bench_file)] if request.bench_file else [])]
    return {"expression": pattern.expression, "name": pattern.name, "command": shlex.join(words)}


def told(pattern: Pattern | None, model: str, request: Request) -> list[str]:
    """What a person may do about what is left."""
    if found := own_effect(pattern, model, request):
        return [
            "To take it into the model as an effect of your own (and then see what is left):",
            f"    {found['command']}",
        ]
    if pattern is not None and pattern.poses and not Path(data := request.data).exists():
        return [f"Look at them: rig show {data} --poses. rig exclude {data} POSE leaves one out, with a reason."]
    return []
