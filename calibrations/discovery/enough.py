"""A search that stops at an error that is small enough: `--enough 0.5mg`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from calibrations.discovery.findings import Findings
from calibrations.errors import ModelError
from calibrations.fitting.fit import Fit, in_milli
from calibrations.free_forms.place_names import PREFIX
from calibrations.geometry.orientation import one_orientation
from calibrations.table import Array
from calibrations.text import add_prefix, join_words, rounded, unit

FLOORS = ("floor", "floors", "x")
OUTPUT, SENSED = "output", "sensed"
# unit -> (what it measures, factor to V or to g, deg/s or the field)
UNITS: Mapping[str, tuple[str, str, float]] = {
    "V": (OUTPUT, "V", 1.0), "mV": (OUTPUT, "V", 1e-3), "uV": (OUTPUT, "V", 1e-6), "µV": (OUTPUT, "V", 1e-6),
    "count": (OUTPUT, "count", 1.0), "counts": (OUTPUT, "count", 1.0),
    "g": (SENSED, "g", 1.0), "mg": (SENSED, "g", 1e-3), "ug": (SENSED, "g", 1e-6), "µg": (SENSED, "g", 1e-6),
    "deg/s": (SENSED, "deg/s", 1.0), "mdeg/s": (SENSED, "deg/s", 1e-3),
}  # fmt: skip
_PATTERN = re.compile(r"\s*(?P<value>[+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(?P<unit>\S*)\s*")


@dataclass(frozen=True)
class Enough:
    """An error on unseen data at which a search stops. `of`: "floors", or a unit in `UNITS`."""

    value: float
    of: str

    @property
    def text(self) -> str:
        """The error in words."""
        return f"{self.value:g} noise floors" if self.of == "floors" else f"{self.value:g} {self.of}"

    def limit(self, fit: Fit) -> float:
        """The error in noise floors of a fit. Raises ModelError if the data have another unit."""
        if self.of == "floors":
            return self.value
        measures, base, factor = UNITS[self.of]
        if measures == SENSED and one_orientation(fit.table):
            raise ModelError(
                f"the limit {self.text} needs the scale factor, which data at one orientation do not show; give a "
                f"limit in {unit(fit.table.unit)} or floors"
            )
        data_unit = fit.table.unit if measures == OUTPUT else fit.table.input_unit
        if base != data_unit:
            other_unit = fit.table.input_unit if measures == OUTPUT else fit.table.unit
            raise ModelError(
                f"the limit {self.text} does not fit this data: the outputs are in {unit(fit.table.unit)}, the input "
                f"is in {unit(fit.table.input_unit)}; give a limit in {unit(data_unit)}, {unit(other_unit)} or floors"
            )
        floor = fit.noise.floor if measures == OUTPUT else in_milli(fit.noise.floor, fit) / 1e3
        return self.value * factor / _pool_channels(floor)

    def error(self, fit: Fit) -> str:
        """The error on unseen data, in this unit."""
        if self.of == "floors":
            return f"{rounded(fit.held_out_excess)} noise floors"
        measures, base, _ = UNITS[self.of]
        floor = fit.noise.floor if measures == OUTPUT else in_milli(fit.noise.floor, fit) / 1e3
        value = fit.held_out_excess * _pool_channels(floor)
        scale, name = add_prefix(base, value)
        return f"{rounded(scale * value)} {name}"


def parse_enough(text: str) -> Enough:
    """`0.5mg`, `2 mV` or `1.5floors`. Raises ModelError."""
    match = _PATTERN.fullmatch(text)
    try:
        value = float(match["value"]) if match else np.nan
    except ValueError:
        value = np.nan
    name = match["unit"] if match else ""
    if not value > 0 or not np.isfinite(value) or (name not in UNITS and name not in FLOORS):
        raise ModelError(f'"{text}" is not a limit for the error; give a number with mg, mV or floors, such as 0.5mg')
    return Enough(value, "floors" if name in FLOORS else name)


def until(findings: Findings[Fit], enough: Enough) -> Findings[Fit]:
    """The findings up to the first model whose error on unseen data is small enough. Raises ModelError."""
    fits = [findings.baseline, *(step.after for step in findings.steps)]
    k = next((k for k, fit in enumerate(fits) if fit.held_out_excess <= enough.limit(fit)), None)
    if k is None:
        error = enough.error(findings.end)
        remark = f"The error on {findings.data.unseen} is {error}, above the limit ({enough.text})."
        return replace(findings, remarks=(*findings.remarks, remark))
    kept_steps, omitted_steps = findings.steps[:k], findings.steps[k:]
    names = {step.name for step in kept_steps}
    remark = f"The error on {findings.data.unseen} is {enough.error(fits[k])}, within the limit ({enough.text})."
    if omitted_steps:
        remark += f" Left out: {join_words([step.name for step in omitted_steps])}."
    return replace(
        findings,
        steps=kept_steps,
        causes=tuple(cause for cause in findings.causes if cause in names),
        alternatives={name: rivals for name, rivals in findings.alternatives.items() if name in names},
        separations={name: plan for name, plan in findings.separations.items() if name in names},
        places=tuple(p for p in findings.places if names & {*p.causes, f"{PREFIX}{p.name}"}),
        left=None,
        pattern=None,
        enough=True,
        remarks=(*findings.remarks, remark),
    )


def _pool_channels(floor: Array) -> float:
    """Rms over the channels."""
    return float(np.sqrt(np.mean(floor**2)))
