"""How the program answers a file of measurements: by refusing it, by a remark, or with values, in this process."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from calibrations.errors import CalibrationError
from rig.services.load import load_request
from rig.services.request import Request

REFUSED, WARNED, HARMLESS, SILENT = "refused", "warned", "harmless", "silent"


@dataclass(frozen=True)
class Answer:
    """The first sentence of an answer, and the values of the parameters with their standard uncertainties."""

    kind: str
    text: str = ""
    values: dict[str, tuple[float, float]] = field(default_factory=dict)
    excess: float = 0.0


def answer(path: Path, model: str, good: Answer | None = None) -> Answer:
    """The answer of `rig fit PATH --model MODEL`, beside that to the good file."""
    notes: list[str] = []
    try:
        found = load_request(Request(str(path), model), notes.append)
        fitted = found.data.fit(found.model)
        rejection = found.data.rejection(fitted)
        notes += found.data.cautions(fitted)
    except CalibrationError as error:
        return Answer(REFUSED, str(error))
    if rejection is not None:
        return Answer(REFUSED, rejection.text)
    values = {name: (e.value, e.std or 0.0) for name, e in fitted.model.params.items()}
    excess = getattr(fitted, "pooled_excess", 0.0)
    if notes:
        return Answer(WARNED, " | ".join(notes), values, excess)
    if good is not None and _alike(good.values, values):
        return Answer(HARMLESS, "", values, excess)
    return Answer(SILENT, "", values, excess)


def _alike(good: dict[str, tuple[float, float]], values: dict[str, tuple[float, float]]) -> bool:
    """Whether all parameters differ by less than their standard uncertainty, and so do the uncertainties."""
    if good.keys() != values.keys():
        return False
    return all(
        abs(value - good[name][0]) <= min(std, good[name][1]) and 0.5 * good[name][1] <= std <= 2 * good[name][1]
        for name, (value, std) in values.items()
    )
