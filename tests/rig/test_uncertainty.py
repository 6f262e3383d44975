"""What a bench file says of its inputs' uncertainty goes with every table, under the names that the budget reads."""

from __future__ import annotations

from pathlib import Path

import pytest

from calibrations.fitting.inputs import input_contributions
from calibrations.table import Table
from rig.bench import Bench, read_bench
from rig.bench.parts import Uncertainty
from rig.errors import BenchError

ONE = {"alpha_deg": [90.0], "beta_deg": [0.0], "vx_v": [3.5], "temperature_c": [22.0]}


def test_every_uncertainty_of_the_bench_is_one_of_the_budget() -> None:
    bench = Bench(instruments={}, uncertainty=Uncertainty(**dict.fromkeys(Uncertainty.model_fields, 0.5)))
    table = Table.from_columns("poses", ONE, bench.constants)
    silent = {c.source for c in input_contributions(table) if c.std is None}
    assert silent == {"true angle of alpha", "true angle of beta"}  # those have error tables


def test_uncertainties_that_are_not_given_are_no_constants() -> None:
    assert not any("std" in name for name in Bench(instruments={}).constants)


def test_a_misspelt_uncertainty_is_refused_with_the_nearest(tmp_path: Path) -> None:
    file = tmp_path / "bench.yaml"
    file.write_text("instruments: {}\nuncertainty: {gain_sdt: 1e-4}\n")
    with pytest.raises(BenchError, match="gain_std"):
        read_bench(file)
