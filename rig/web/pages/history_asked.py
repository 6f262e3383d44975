"""What the page of a sensor's life is asked. Its address says it by the options of `rig history`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date
from urllib.parse import urlencode

from starlette.datastructures import QueryParams

from calibrations.evaluations.control_chart import BASELINE, FEWEST
from rig.analysis.history_limits import changes
from rig.analysis.provenance import today
from rig.errors import RigError

MODEL = "linear"


@dataclass(frozen=True)
class Asked:
    """`sensor` "" is none, `quantity` "" the first; `limits` are greatest changes, `at` the day that is asked for."""

    sensor: str = ""
    model: str = MODEL
    quantity: str = ""
    limits: Mapping[str, float] = field(default_factory=dict)
    baseline: int = BASELINE
    at: date = field(default_factory=lambda: date.fromisoformat(today()))

    @property
    def address(self) -> str:
        """Of the page; what is as by default is left out."""
        said = {
            "sensor": self.sensor,
            "model": self.model if self.model != MODEL else "",
            "quantity": self.quantity,
            "limit": [f"{name}={change:g}" for name, change in self.limits.items()],
            "baseline": str(self.baseline) if self.baseline != BASELINE else "",
            "at": str(self.at) if str(self.at) != today() else "",
        }
        given = urlencode({name: value for name, value in said.items() if value}, doseq=True)
        return f"/history?{given}" if given else "/history"


def asked(query: QueryParams) -> Asked:
    """What an address asks. Raises RigError."""
    return Asked(
        query.get("sensor", ""),
        query.get("model", "") or MODEL,
        query.get("quantity", ""),
        changes(query.getlist("limit")),
        _baseline(query.get("baseline", str(BASELINE))),
        day(query.get("at", today())),
    )


def day(text: str) -> date:
    """A day as it is written. Raises RigError."""
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise RigError(f"{text!r} is no day: write it as {today()}") from None


def _baseline(text: str) -> int:
    if not text.isdecimal() or int(text) < FEWEST:
        raise RigError(f"baseline={text}: write how many calibrations set the charts, {FEWEST} at least")
    return int(text)
