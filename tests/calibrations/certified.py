"""A certificate written by hand, and one of a table with a known truth."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from calibrations.fitting.fit import Fit, fit
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.presentation.certificate.content import Certificate, Condition, Instrument, Laboratory, Sample
from calibrations.presentation.certificate.results import figures
from calibrations.table import Table
from tests.calibrations.synthetic import components, poses, turns

LIMITS = {"bias-x": (2.4, 2.6), "scale-factor-x": (1.0005, 1.1), "scale-factor-y": (0.9, 0.979)}
LABORATORY = Laboratory("Lab <&> Co", "A. Person", "head", "a@lab.example", "Main Street 1", "10000", "Town", "DE")


def table(seed: int = 3, **constants: float) -> Table:
    """Two axes with bias 2.5 and 2.45 V, scale factor 1.001 and 0.98 V/g, and white noise of 50 uV."""
    columns = turns((90, 30, 150), step_deg=30.0)
    x, y, _ = components(columns)
    made = poses(columns, 2.5 + 1.001 * x, 2.45 + 0.98 * y, seed=seed)
    kept = {**made.columns, "temperature_c": np.linspace(22.0, 24.0, made.n)}
    return Table.from_columns("poses", kept, {"gravity_m_s2": 9.81, **constants}, "made")


@cache
def fitted() -> Fit:
    """The linear model on it, with inputs that no fit can know."""
    return fit(read_model("linear"), table(gain_std=1e-4, tilt_std_deg=0.02))


def before() -> Model:
    """The model of a year ago: other data, another bias."""
    old = fit(read_model("linear"), table(seed=9)).model
    bias = old.terms[0]
    moved = replace(bias, estimates=tuple(replace(e, value=e.value - 0.002) for e in bias.estimates))
    return replace(old, terms=(moved, *old.terms[1:]))


@cache
def certificate() -> Certificate:
    """A whole one."""
    found = fitted()
    rows = enumerate(found.table.outputs.tolist())
    return Certificate(
        number="C-2026-17",
        issued="2026-11-21",
        program="inertial-rig 0.1.0",
        laboratory=LABORATORY,
        customer="Somebody Ltd",
        sensor="ADXL203",
        serial="17",
        manufacturer="Analog Devices",
        rig="the rig",
        instruments=(Instrument("adc", "LabJack T7", "470", "1.03", "CAL-7", "2027-01-01"),
                     Instrument("level", "DPG2", certificate="CAL-8", due="2020-01-01", expired=True)),
        procedure="sweep",
        facts={"run": "a run", "step": "30"},
        began="2026-11-20T10:00:00+00:00",
        ended="2026-11-20T11:00:00+00:00",
        gravity_m_s2=9.81,
        conditions=(Condition("temperature", "C", 22.0, 23.0, 24.0),),
        before="the model of last year",
        figures=figures(found, before(), LIMITS, trials=400),
        samples=tuple(Sample(i, 7.0 * i, "alpha 90", tuple(v), 5000, f"{i:064x}") for i, v in rows),
        data="a run",
        data_sha256=found.table.digest,
        model_sha256="ab" * 32,
        remarks=("The level's certificate expired.",),
    )  # fmt: skip
