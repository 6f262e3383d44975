"""What `import calibrations as cal` gives."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import calibrations as cal
from calibrations.errors import DataError
from calibrations.table import Array, Table
from tests.calibrations import synthetic


def force_and_table() -> tuple[Array, Table]:
    columns = synthetic.turns(step_deg=30)
    x, y, _ = synthetic.components(columns)
    measured = synthetic.poses(columns, 2.5 + x, 2.5 + 1.1 * y)
    return np.column_stack([x, y]), cal.table(dict(measured.columns), "poses", measured.constants)


def test_a_fit_is_compensated_back_to_the_specific_force() -> None:
    a, data = force_and_table()
    found = cal.fit(data, "linear")
    assert found.params["scale-factor.y"].value == pytest.approx(1.1, abs=1e-4)
    assert np.abs(cal.compensate(found.model, data.outputs) - a).max() < 5e-4
    with pytest.raises(DataError, match="the model has the axes x, y"):
        cal.compensate(found.model, data.outputs[:, :1])


def test_the_functions_stay_where_submodules_have_their_names() -> None:
    import calibrations.fitting.fit
    import calibrations.noise.record
    import calibrations.table  # noqa: F401

    assert all(callable(getattr(cal, name)) for name in cal.__all__)


def test_importing_the_package_loads_no_analysis() -> None:
    code = "import sys, calibrations; print([m for m in ('scipy', 'numba', 'yaml') if m in sys.modules])"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["[]"]
