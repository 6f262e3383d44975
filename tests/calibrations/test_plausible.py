"""Numbers that can hardly be in their unit are refused with the unit that fits; whoever states the unit is believed."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pytest

from calibrations.errors import DataError
from calibrations.files import text_source
from calibrations.importing.foreign import drop_duplicate_rows, import_sheet
from calibrations.importing.plausible import gravity_unit, log_rate_hz, looks_like_radians
from calibrations.importing.raw_logs import average_raw_log
from calibrations.importing.sheet import read_sheet
from calibrations.importing.units import ColumnMapping
from calibrations.table import Table

TURN = np.arange(0.0, 361.0, 30.0)


def poses(alpha: float = 90.0, scale: float = 1.0, **more: float) -> str:
    """A turn of beta at one inclination, as CSV; `scale` times its angles, and more constant columns."""
    head = ",".join(["alpha_deg", "beta_deg", "vx_v", *more])
    beta = [f"{scale * alpha:.6g},{scale * b:.6g},{more.get('vx_v', 2.5)}" for b in TURN]
    return "\n".join([head, *(",".join([row, *map(str, more.values())]) for row in beta)]) + "\n"


def read(content: str, *columns: str, kind: str | None = None) -> Table:
    return import_sheet(
        read_sheet(text_source(content, "some.csv")), kind, [ColumnMapping.parse(c) for c in columns]
    ).table


@pytest.mark.parametrize(
    ("content", "name", "says", "fits"),
    [
        (poses(scale=np.pi / 180), "alpha_deg", "it looks like radians", "alpha_deg=alpha_deg:rad"),
        (poses(scale=np.pi / 180), "alpha_deg", "it looks like radians", "beta_deg=beta_deg:rad"),
        (poses(vy_v=2500.0), "vy_v", "reaches 2500 V; no sensor output exceeds 50 V", "vy_v=vy_v:mV"),
        (poses(supply_v=5000.0), "supply_v", "reaches 5000 V", "supply_v=supply_v:mV"),
        (poses(vy_v=2.5e6), "vy_v", "reaches 2.5e+06 V", "vy_v=vy_v:uV"),
        (poses(temperature_c=295.0), "temperature_c", "from 295 to 295 degC", "temperature_c=temperature_c:K"),
    ],
)
def test_an_implausible_unit_is_refused_with_the_command_that_corrects_it(
    content: str, name: str, says: str, fits: str
) -> None:
    with pytest.raises(DataError, match=re.escape(f'some.csv: the column "{name}" ')) as error:
        read(content)
    assert says in str(error.value)
    line = next(
        line for line in str(error.value).splitlines() if line.startswith("    rig import some.csv --kind poses")
    )
    assert f"--column {fits}" in line
    # what the message says is done: by the proposal, and by stating the unit all the same
    options = re.findall(r"--column (\S+)", line)
    assert read(content, *options).kind == "poses"
    stated = [re.sub(r":\w+$", "", option) for option in options]
    own = {"alpha_deg": "deg", "beta_deg": "deg", "temperature_c": "degC"}
    assert read(content, *(f"{each}:{own.get(each.partition('=')[0], 'V')}" for each in stated)).kind == "poses"


@pytest.mark.parametrize(
    ("column", "says"),
    [
        ("alpha_deg=alpha_deg:rad", "reaches 5156.62 deg; no stage turns beyond 360 deg; state its unit"),
        ("beta_deg=beta_deg:rad", "reaches 20626.5 deg; no stage turns beyond 3600 deg; state its unit"),
    ],
)
def test_degrees_in_a_column_of_radians_are_refused(column: str, says: str) -> None:
    with pytest.raises(DataError, match=re.escape(says)):
        read(poses(), column)


def test_a_mapping_without_a_unit_states_none() -> None:
    content = poses().replace("vx_v", "Ux").replace("2.5\n", "2500\n")
    with pytest.raises(DataError, match="--column vx_v=Ux:mV"):
        read(content, "vx_v=Ux")
    assert read(content, "vx_v=Ux:V").n == len(TURN)


def test_what_nobody_knows_a_unit_for_may_still_be_stated() -> None:
    with pytest.raises(DataError, match="state its unit, as in --column temperature_c=temperature_c:degC"):
        read(poses(temperature_c=5000.0))
    assert read(poses(temperature_c=5000.0), "temperature_c=temperature_c:degC").n == len(TURN)


@pytest.mark.parametrize(
    ("angles", "expected"),
    [
        (np.radians(TURN), True),
        (np.radians([30, 90, 150]), True),
        (np.round(np.radians(np.arange(0, 360, 10)), 2), True),
        ([0.3, 0.71, 1.93, 2.22, 3.04, 4.4, 5.1], True),
        (np.arange(0.0, 7.0), False),
        (np.arange(-2.0, 2.1, 0.1), False),
        (np.arange(24) / 12, False),  # the stages' steps of 5 arcmin
        (np.round(np.arange(24) / 12, 3), False),
        ([0.0, 0.0], False),
        (TURN, False),
        ([0.3, 0.7], False),  # two values say too little
        ([0.5, 1e308], False),  # too large to be rounded
    ],
)
def test_radians_are_off_every_grid_of_degrees(angles: Sequence[float], expected: bool) -> None:
    assert looks_like_radians(np.asarray(angles, dtype=float)) is expected


@pytest.mark.parametrize(("size", "unit"), [(1.02, "g"), (9.79, "m/s2"), (995.0, "mg"), (16384.0, "counts")])
def test_gravity_gives_the_unit_of_a_sensor_at_rest(size: float, unit: str) -> None:
    assert gravity_unit(size * np.vstack([np.eye(3), -np.eye(3)])) == unit


def test_a_sensor_at_rest_shows_gravity() -> None:
    content = "ax,ay,az\n9.8,0,0\n0,9.8,0\n0,0,9.8\n"
    with pytest.raises(DataError, match=r"have the magnitude 9.8 g; a sensor at rest shows 1; they look like m/s2"):
        read(content, "ax=ax:g", "ay=ay:g", "az=az:g")
    with pytest.raises(DataError, match=r"the magnitude 1 m/s2; a sensor at rest shows 9.807; they look like g"):
        read(content.replace("9.8", "1"), *(f"{a}={a}:m/s2" for a in ("ax", "ay", "az")))
    with pytest.raises(DataError, match=r"import outputs of an unknown scale as counts: --column ax=\.\.\.:counts"):
        read(content.replace("9.8", "17"), "ax=ax:g", "ay=ay:g", "az=az:g")
    assert read(content, *(f"{a}={a}:m/s2" for a in ("ax", "ay", "az"))).unit == "m/s2"
    assert read(content, *(f"{a}={a}:counts" for a in ("ax", "ay", "az"))).unit == "count"


TURNS = 3 * [40.0, -40.0, 75.0, -75.0, 0.0]


def rates(rate: float = 1.0, output: float = 1.0) -> str:
    """Turns about x, y and z at rates off every grid, as CSV; `rate` and `output` times the values in deg/s."""
    rows = [(k // 5, 0.91 * turn) for k, turn in enumerate(TURNS)]
    cells = [[*np.eye(3)[k], rate * turn, *(output * turn * np.eye(3)[k] + output * 0.4)] for k, turn in rows]
    text = "\n".join(",".join(f"{v:.6g}" for v in row) for row in cells)
    return f"axis_x,axis_y,axis_z,rate_deg_s,gx,gy,gz\n{text}\n"


def test_rates_in_radians_are_known_by_a_gyroscope_in_degrees() -> None:
    degrees = [f"{name}={name}:deg/s" for name in ("gx", "gy", "gz")]
    with pytest.raises(DataError, match=r"show 57\.\d deg/s for each deg/s of rate_deg_s; rate_deg_s looks like rad/s"):
        read(rates(rate=np.pi / 180), *degrees)
    with pytest.raises(DataError, match=r"show 0\.017\d deg/s .*; gx, gy, gz look like rad/s: give --column gx="):
        read(rates(output=np.pi / 180), *degrees)
    right = read(rates(rate=np.pi / 180), *degrees, "rate_deg_s=rate_deg_s:rad/s")
    np.testing.assert_allclose(right.column("rate_deg_s"), 0.91 * np.array(TURNS), rtol=1e-5)
    assert read(rates(output=16.4)).unit == "count"


@pytest.mark.parametrize(
    ("turns", "doubtful"),
    [([30.0, 90.0], True), ([10.0, 20.0, 45.0], True), ([30.0], False), ([4.8, 0.35], False)],
)
def test_rates_that_are_round_in_radians_are_asked_about(turns: list[float], doubtful: bool) -> None:
    values = np.radians(turns) if doubtful else np.array(turns)
    content = "rate_deg_s,gx,gy,gz\n" + "".join(f"{sign * v:.5f},{v},0,0\n" for v in values for sign in (1, -1))
    if not doubtful:
        assert read(content, kind="rates").n == 2 * len(turns)
        return
    with pytest.raises(DataError, match="in whole multiples of 5 deg/s if it is in rad/s"):
        read(content, kind="rates")


def log(step: float, n: int = 1200) -> str:
    """A log of a sensor on two of its sides in turn, with a time step, as CSV."""
    noise = np.random.default_rng(1).normal(scale=1e-3, size=(n, 3))
    sides = np.eye(3)[np.arange(n) // 300 % 3] + noise
    rows = (f"{step * k:.9g},{x:.5f},{y:.5f},{z:.5f}" for k, (x, y, z) in enumerate(sides))
    return "\n".join(["t_s,ax,ay,az", *rows]) + "\n"


@pytest.mark.parametrize(("step", "unit"), [(10.0, "ms"), (1.0, "ms"), (1e4, "us"), (250.0, "us")])
def test_a_log_too_slow_in_seconds_is_asked_about(step: float, unit: str) -> None:
    with pytest.raises(
        DataError, match=rf'column "t_s" gives \S+ samples a second if it is in s\nIf .*{unit}'
    ) as error:
        read(log(step))
    (option,) = re.findall(r"--column (t_s=\S+)", str(error.value).splitlines()[3])
    assert option == f"t_s=t_s:{unit}"
    assert read(log(step), option).n == 1200
    assert read(log(step), "t_s=t_s:s").n == 1200


def test_a_stated_sample_rate_that_does_not_fit_is_refused() -> None:
    with pytest.raises(DataError, match="t_s gives 100 samples a second, and the constant sample_rate_hz is 200"):
        average_raw_log(read("# sample_rate_hz: 200\n" + log(0.01)))
    assert average_raw_log(read("# sample_rate_hz: 100.5\n" + log(0.01))).n == 4
    timeless = "\n".join(line.partition(",")[2] for line in log(0.01).splitlines())
    with pytest.raises(DataError, match=r"at 100000 samples a second this log of 1200 samples lasts 0\.012 s"):
        average_raw_log(read("# sample_rate_hz: 100000\n" + timeless))


@pytest.mark.parametrize(
    ("clock", "stated_hz", "fits"),
    [
        ("time (ms)", 200, "t_s=time (ms):ms"),
        ("t", 10, "t_s=t"),
        ("time (ms)", 100, ""),
        ("ticks", 200, ""),  # whose name and unit mean no time
    ],
)
def test_a_stated_sample_rate_is_checked_by_a_time_of_another_name(clock: str, stated_hz: float, fits: str) -> None:
    step = 10 if "ms" in clock else 0.01
    content = f"# sample_rate_hz: {stated_hz}\n" + log(step).replace("t_s", clock)
    if not fits:
        assert average_raw_log(read(content)).n == 4
        return
    with pytest.raises(
        DataError, match=rf'"{re.escape(clock)}" .* 100 samples a second, .* is {stated_hz:g};'
    ) as error:
        read(content)
    assert f"--column {fits})" in str(error.value)
    again = content.partition("\n")[2]
    assert average_raw_log(read(again, fits)).n == average_raw_log(read(f"# sample_rate_hz: 100\n{again}")).n == 4


def test_a_clock_without_a_unit_may_have_the_stated_rate_in_any_unit_or_count_unknown_ticks() -> None:
    for step in (10.0, 1e4, 1e7, 7.0):
        assert average_raw_log(read("# sample_rate_hz: 100\n" + log(step).replace("t_s", "time"))).n == 4


def test_a_clock_that_began_again_does_not_change_the_sample_rate() -> None:
    time_s = np.concatenate([0.01 * np.arange(700), 0.01 * np.arange(500)])
    assert log_rate_hz(time_s, 0.0, "some.csv") == pytest.approx(100.0)
    assert log_rate_hz(time_s, 100.0, "some.csv") == pytest.approx(100.0)
    assert log_rate_hz(None, 50.0, "some.csv") == 50.0
    assert log_rate_hz(np.zeros(5), 0.0, "some.csv") == 0.0


def test_rows_that_occur_twice_are_used_once() -> None:
    columns = {"t_s": [0.0, 1, 2, 0, 1], "alpha_deg": [90.0] * 5, "beta_deg": [0.0, 30, 60, 0, 30], "vx_v": [1.0] * 5}
    kept, said = drop_duplicate_rows(Table.from_columns("poses", columns, source="made"))
    assert kept.n == 3
    assert said is not None
    assert said.startswith("made: rows 4 (as 1), 5 (as 2) copy earlier rows (same time, same values)")
    for name, values in {"t_s": [0.0, 1, 2, 3, 4], "vx_v": [1.0, 1, 1, 1.1, 1.1]}.items():  # measured again
        again = Table.from_columns("poses", {**columns, name: values})
        assert drop_duplicate_rows(again) == (again, None)
    del columns["t_s"]
    timeless = Table.from_columns("poses", columns)  # maybe read to few digits
    assert drop_duplicate_rows(timeless) == (timeless, None)
