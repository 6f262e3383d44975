"""Settings as people read and write them: `step_deg = 10.0` as `step (deg)`, `10`."""

from __future__ import annotations

from typing import Any

UNITS = {  # ends of names, longest first
    "deg_s": "deg/s",
    "m_s2": "m/s²",
    "deg": "deg",
    "hz": "Hz",
    "um": "µm",
    "c": "°C",
    "s": "s",
}


def label(name: str) -> str:
    """`step_deg` as `step (deg)`."""
    unit = next((end for end in UNITS if name.endswith(f"_{end}")), "")
    head = name.removesuffix(f"_{unit}").replace("_", " ")
    return f"{head} ({UNITS[unit]})" if unit else head


def written(value: Any) -> str:
    """A setting as it is typed."""
    if isinstance(value, (list, tuple)):
        return ",".join(f"{part:g}" if isinstance(part, float) else str(part) for part in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)
