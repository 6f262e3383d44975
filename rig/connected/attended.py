"""The person at the rig, for a driver that asks one: its questions are those of the run.

So a file of answers, the simulated technician and `--unattended` hold for them as for any other question, and what was
answered is in the record.
"""

from __future__ import annotations

from dataclasses import dataclass

from procedures.questions import Dial
from procedures.session import Host


@dataclass(frozen=True)
class AtTheRig:
    """Whoever answers the questions of a run."""

    host: Host

    def ask(self, name: str, text: str, unit: str, low: float, high: float, expected: float | None = None) -> float:
        """The number that they read. Raises NoAnswer, BadAnswer."""
        stage = name.partition("-")[0]
        return float(self.host.ask(Dial(name, text, unit=unit, low=low, high=high, stage=stage, expected=expected)))
