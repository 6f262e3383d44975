"""What a file's columns are taken for: by name, by unit, by values; and the command that the message ends with."""

from __future__ import annotations

import shlex
from itertools import pairwise

import numpy as np
import pytest

from calibrations.errors import DataError, MissingColumn
from calibrations.files import text_source
from calibrations.importing.foreign import import_sheet, needs_mapping
from calibrations.importing.proposal import likely_kind, propose_mapping
from calibrations.importing.sheet import Sheet, read_sheet
from calibrations.importing.suggestion import import_command
from calibrations.importing.units import ColumnMapping, parse_unit, split_unit
from calibrations.table import Array


def laid(content: str) -> Sheet:
    return read_sheet(text_source(content, "theirs.csv"))


def proposed(content: str, kind: str | None = None, *mapped: str) -> set[str]:
    return {m.text for m in propose_mapping(laid(content), kind, [ColumnMapping.parse(m) for m in mapped])}


ROWS = "90;0;3500\n90;30;3400\n30;0;3000\n"


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("inclination;table angle;Vout", {"alpha_deg=inclination", "beta_deg=table angle", "vx_v=Vout:mV"}),
        ("Alpha;Beta;Vx (mV)", {"alpha_deg=Alpha", "beta_deg=Beta", "vx_v=Vx (mV):mV"}),
        ("tilt [deg];azimuth [deg];out_y", {"alpha_deg=tilt [deg]:deg", "beta_deg=azimuth [deg]:deg", "vy_v=out_y:mV"}),
        ("alphaAngle;tableAngle;accX", {"alpha_deg=alphaAngle", "beta_deg=tableAngle", "vx_v=accX:mV"}),
        ("alpha_deg;beta_deg;signal", {"vx_v=signal:mV"}),
        ("pitch;yaw;CH0", {"alpha_deg=pitch", "beta_deg=yaw", "vx_v=CH0:mV"}),
        (
            "Neigung [Grad];Drehung [Grad];Ausgang X [mV]",
            {"alpha_deg=Neigung [Grad]:deg", "beta_deg=Drehung [Grad]:deg", "vx_v=Ausgang X [mV]:mV"},
        ),
        ("Neigungswinkel;Drehtisch;Ux", {"alpha_deg=Neigungswinkel", "beta_deg=Drehtisch", "vx_v=Ux:mV"}),
        ("inclinaison;plateau;Ux", {"alpha_deg=inclinaison", "beta_deg=plateau", "vx_v=Ux:mV"}),
        ("Outer axis;Inner axis;Ux", {"alpha_deg=Outer axis", "beta_deg=Inner axis", "vx_v=Ux:mV"}),
    ],
)
def test_columns_are_proposed_by_their_names_and_values(header: str, expected: set[str]) -> None:
    assert proposed(f"{header}\n{ROWS}") == expected


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("time", 3, "t_s=time"),
        ("Time (min)", 3, "t_s=Time (min):min"),
        ("temp", 22, "temperature_c=temp"),
        ("T", 295, "temperature_c=T:K"),
        ("Temperature/°C", 22, "temperature_c=Temperature/°C:degC"),
        ("body [°F]", 72, "temperature_c=body [°F]:degF"),
        ("Vdd", 5, "supply_v=Vdd"),
        ("turning", 1, "direction=turning"),
        ("std_x", 0.7, "vx_std_v=std_x:mV"),
        ("noise y", 0.7, "vy_std_v=noise y"),
        ("samples", 500, "n=samples"),
        ("Zeit [min]", 3, "t_s=Zeit [min]:min"),
        ("minutes", 3, "t_s=minutes:min"),
        ("Hours", 3, "t_s=Hours:h"),
        ("temps (min)", 3, "t_s=temps (min):min"),
        ("temperature (s)", 3, "t_s=temperature (s):s"),
        ("humidity", 40, None),
    ],
)
def test_further_columns_are_proposed(name: str, value: float, expected: str | None) -> None:
    rows = "".join(f"90;{k};3500;{value}\n" for k in (0, 30, 60))
    found = proposed(f"alpha_deg;beta_deg;Vx;{name}\n{rows}")
    assert found == {"vx_v=Vx:mV"} | ({expected} if expected else set())


def test_an_output_is_not_proposed_in_the_unit_of_another_quantity() -> None:
    assert proposed("alpha_deg;beta_deg;signal (deg)\n" + ROWS) == set()
    assert proposed("alpha_deg;beta_deg;signal (mV)\n" + ROWS) == {"vx_v=signal (mV):mV"}


def test_radians_are_proposed_as_such() -> None:
    rows = "".join(f"1.5708,{b:.4f},2.5\n" for b in np.radians(np.arange(0, 360, 30)))
    assert proposed(f"alpha,beta,vx_v\n{rows}") == {"alpha_deg=alpha:rad", "beta_deg=beta:rad"}


@pytest.mark.parametrize(
    ("one_g", "unit"), [(1.0, "g"), (9.81, "m/s2"), (4096.0, "counts"), (2.5, "V"), (3.0, "counts"), (4096.5, "counts")]
)
def test_three_axes_are_positions_in_the_unit_that_gravity_gives(one_g: float, unit: str) -> None:
    rows = "".join(f"{k},{one_g * (k == 0)},{one_g * (k == 1)},{one_g * (k == 2)},7\n" for k in range(3))
    content = f"time,accX,accY,accZ,gyrX\n{rows}"
    assert likely_kind(laid(content)) == "positions"
    axes = {f"a{axis}=acc{axis.upper()}:{unit}" for axis in "xyz"}
    assert proposed(content) == {"t_s=time", "gx=gyrX", *axes}
    assert proposed(content.replace(f"{one_g}", f"-{one_g}")) == {"t_s=time", "gx=gyrX", *axes}


def test_columns_without_names_are_told_by_their_values() -> None:
    turn = "".join(
        f"{k}.5 {a} {b} {2.5 + b / 1000}\n" for k, (a, b) in enumerate([(90, 0), (90, 30), (90, 60), (30, 0)])
    )
    assert proposed(turn) == {"t_s=1", "alpha_deg=2", "beta_deg=3", "vx_v=4"}
    assert proposed(turn.replace("\n", " 22.1\n")) == {"t_s=1", "alpha_deg=2", "beta_deg=3", "vx_v=4"}  # no output
    held = "".join(f"{k} {x} {y} {z}\n" for k, (x, y, z) in enumerate(np.roll(np.eye(3), 1, axis=0) * 9.8))
    assert proposed(held) == {"t_s=1", "ax=2:m/s2", "ay=3:m/s2", "az=4:m/s2"}


def test_a_displacement_makes_it_motion() -> None:
    rows = "".join(f"{k / 1000};{2.5 + k / 100};{30 + k}\n" for k in range(20))
    found = proposed(f"time;out_x;displacement\n{rows}")
    assert found == {"t_s=time", "vx_v=out_x", "displacement_m=displacement:um"}
    assert likely_kind(laid(f"time;out_x;displacement\n{rows}")) == "motion"


def test_a_magnetometer_is_told_by_its_names() -> None:
    content = "MagX (uT),MagY (uT),MagZ (uT)\n12,-3,40\n11,-2,41\n"
    assert proposed(content) == {"mx=MagX (uT):uT", "my=MagY (uT):uT", "mz=MagZ (uT):uT"}
    with pytest.raises(MissingColumn, match=r"rig import theirs\.csv --kind positions --column mx=MagX:uT"):
        import_sheet(laid(content), "positions")


def test_a_gyroscope_on_a_table_is_told_by_rate_and_outputs() -> None:
    content = "Table rate (deg/s),acc_x,acc_y,acc_z,gyro_x,gyro_y,gyro_z\n0,1,0,0,1,2,3\n30,1,0,0,500,2,3\n"
    assert likely_kind(laid(content)) == "rates"
    outputs = {f"g{axis}=gyro_{axis}" for axis in "xyz"} | {f"a{axis}=acc_{axis}" for axis in "xyz"}
    assert proposed(content) == outputs | {"rate_deg_s=Table rate (deg/s):deg/s"}
    units = [ColumnMapping.parse(m) for m in ("rate_deg_s=Table rate", "ax=acc_x:g", "ay=acc_y:g", "az=acc_z:g")]
    units += [ColumnMapping.parse(f"g{axis}=gyro_{axis}:rad/s") for axis in "xyz"]
    table = import_sheet(laid(content), "rates", units).table
    assert table.unit == "deg/s"
    assert table.column("gx")[0] == pytest.approx(np.degrees(1.0))


def test_what_is_given_already_stays() -> None:
    found = proposed(f"a;b;Vout\n{ROWS}", None, "alpha_deg=b", "beta_deg=a:rad")
    assert found == {"alpha_deg=b", "beta_deg=a:rad", "vx_v=Vout:mV"}


def test_a_message_ends_with_the_command_that_works() -> None:
    content = f"Inclination (°);Table angle (°);Vx [mV]\n{ROWS}"
    with pytest.raises(MissingColumn) as error:
        import_sheet(laid(content), None)
    line = str(error.value).splitlines()[-1]
    assert shlex.split(line)[:5] == ["rig", "import", "theirs.csv", "--kind", "poses"]
    columns = [ColumnMapping.parse(word) for word in shlex.split(line)[6::2]]
    assert import_sheet(laid(content), "poses", columns).table.column("vx_v").tolist() == [3.5, 3.4, 3.0]


def test_what_is_still_to_be_named_is_said(golden) -> None:
    with golden.refused(MissingColumn):
        import_sheet(laid(f"one;two;Vout\n{ROWS}"), None)


def test_a_mapping_is_needed_where_our_names_are_missing() -> None:
    assert not needs_mapping(laid(f"alpha_deg (°);beta_deg;vx_v [mV]\n{ROWS}"), None, [])
    assert needs_mapping(laid(f"alpha_deg;beta_deg;Vout\n{ROWS}"), None, [])
    assert not needs_mapping(laid(f"alpha_deg;beta_deg;Vout\n{ROWS}"), None, [ColumnMapping("vx_v", "Vout", "mV")])
    assert needs_mapping(laid(f"alpha_deg;beta_deg;vx_v\n{ROWS}"), "positions", [])


def test_the_command_holds_all_that_was_said() -> None:
    words = shlex.split(
        import_command(laid(f"a a;b;c\n{ROWS}"), "poses", [ColumnMapping("vx_v", "a a", "mV")], ["sensor=A 7"])
    )
    assert words == [
        *("rig", "import", "theirs.csv", "--kind", "poses"),
        *("--column", "vx_v=a a:mV", "--constant", "sensor=A 7"),
    ]


def test_spellings_of_units_are_understood() -> None:
    assert [parse_unit(u) for u in ("mV", "°", "[°C]", "m/s²", "Volts", "µV", "k", "kPa", "")] == [
        "mV", "deg", "degC", "m/s2", "V", "uV", "", "", "",
    ]  # fmt: skip
    assert split_unit("Vx [mV]") == ("Vx", "mV")
    assert split_unit("Run (raw data)") == ("Run (raw data)", "")


def advised(content: str, **constants: str | float) -> str:
    """The message about a file that is not understood."""
    with pytest.raises(MissingColumn) as error:
        import_sheet(laid(content), None, (), constants)
    return str(error.value)


def session(turned: bool, *, sections: str = "part") -> str:
    """Three rests and three turns about the edges, 40 samples each, with a running number that begins at 1, then 0."""
    random, lines = np.random.default_rng(5), [f"{sections},samples,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z"]
    for k in range(6):
        gyr = np.eye(3)[k % 3] * 800.0 * (turned and k > 2) + [2.0, -5.0, 1.0]
        for i, noise in enumerate(random.normal(0, 1.0, (40, 3))):
            cells = [*(2048.0 * np.eye(3)[k % 3] + noise), *(gyr + noise)]
            lines.append(f"s{k},{(k < 5) + i}," + ",".join(f"{cell:.0f}" for cell in cells))
    return "\n".join(lines) + "\n"


def test_a_session_in_named_sections_is_rates_and_its_counter_counts_nothing() -> None:
    told = advised(session(turned=True))
    assert "(put the angle of each turn in deg for YOURS in turn_deg; the sample rate in Hz" in told
    words = shlex.split(told.splitlines()[-1])
    assert words[3:7] == ["--kind", "rates", "--column", "path=part"]
    assert words[-4:] == ["--constant", "turn_deg=YOURS", "--constant", "sample_rate_hz=YOURS"]
    assert not any("samples" in word for word in words[:-2])
    columns = [ColumnMapping.parse(word) for word in words[6:-4:2]]
    rates = import_sheet(
        laid(session(turned=True)), "rates", columns, {"turn_deg": 360.0, "sample_rate_hz": 40.0}
    ).table
    assert np.unique(rates.column("rate_deg_s")).tolist() == [0.0, 360.0]
    assert not needs_mapping(laid(session(turned=True)), "rates", columns)
    assert "turn_deg=180 --constant sample_rate_hz=YOURS" in advised(session(turned=True), turn_deg=180.0)


def test_sections_in_which_nothing_turns_are_positions() -> None:
    told = advised(session(turned=False))
    assert "--kind positions --column ax=acc_x:counts" in told
    assert "suggest this import:\n" in told


@pytest.mark.parametrize(
    ("values", "counted"),
    [("1 2 3 4", False), ("0 500 500 500", False), ("4.5 4 4 4", False), ("500 500 499 500", True)],
)
def test_only_whole_numbers_that_do_not_run_count_samples(values: str, counted: bool) -> None:
    rows = "".join(f"90;{30 * k};3500;{value}\n" for k, value in enumerate(values.split()))
    assert ("n=samples" in proposed(f"alpha_deg;beta_deg;Vx;samples\n{rows}")) is counted


def test_what_was_tried_in_vain_is_said_so(golden) -> None:
    rows = "".join(f"{9.8 * (k == 0)},{9.8 * (k == 1)},{9.8 * (k == 2)}\n" for k in range(3))
    golden.same(advised(f"accX,accY,accZ\n{rows}"))


def columns_of(values: Array) -> str:
    return "".join(" ".join(f"{v:.5f}" for v in row) + "\n" for row in values)


def test_columns_without_names_are_positions_only_where_they_show_one_magnitude_on_all_sides() -> None:
    random = np.random.default_rng(8)
    sides = random.normal(size=(30, 3))
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    assert "--kind positions --column ax=1:m/s2" in advised(columns_of(9.8 * sides))
    for others in (random.normal(size=(30, 3)), np.cumsum(np.abs(random.normal(size=(30, 3))), axis=0)):
        told = advised(columns_of(others))
        assert told.endswith("; name a column with --column, by its number, such as vx_v=2:mV")
        assert "rig import" not in told


def test_constants_that_are_given_stay_and_a_rate_by_another_name_is_taken() -> None:
    random, rows = np.random.default_rng(2), []
    for side in [*np.eye(3), *-np.eye(3)]:
        rows.append(4096 * side + random.normal(0, 5, (150, 3)))
        rows.append(4096 * random.normal(size=(50, 3)))
    samples = "".join(f"{x:.0f},{y:.0f},{z:.0f}\n" for x, y, z in np.vstack(rows))
    told = advised(f"Fs,50\naccX,accY,accZ\n{samples}", sensor="A 7")
    assert told.endswith("--constant 'sensor=A 7' --constant sample_rate_hz=50\n")
    assert "YOURS" not in told
    assert "(put the sample rate in Hz for YOURS in sample_rate_hz)" in advised(f"accX,accY,accZ\n{samples}")


@pytest.mark.parametrize("triad", ["a", "m"])
def test_of_a_magnetometer_beside_an_accelerometer_each_is_asked_for_its_own_magnitude(triad: str) -> None:
    random = np.random.default_rng(6)
    sides = random.normal(size=(24, 3))
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    rows = "".join(
        ",".join(f"{v:.4f}" for v in (*row, *grav)) + "\n"
        for row, grav in zip(45 * sides + [3.0, -2.0, 8.0], 9.81 * sides[::-1], strict=True)
    )
    content = f"mag_x,mag_y,mag_z,grav_x,grav_y,grav_z\n{rows}"
    words = shlex.split(advised(content, triad=triad).splitlines()[-1])
    assert words[-2:] == ["--constant", f"triad={triad}"]
    taken = import_sheet(
        laid(content), "positions", [ColumnMapping.parse(word) for word in words[6:-2:2]], {"triad": triad}
    ).table
    assert taken.unit == {"a": "m/s2", "m": "uT"}[triad]
    heavy = [ColumnMapping.parse(word.replace("grav", "mag")) for word in words[12:-2:2]]
    with pytest.raises(DataError, match="ax, ay, az have the magnitude 4"):
        import_sheet(laid(content), "positions", heavy, {})


def test_a_field_is_not_asked_for_gravity_whatever_unit_the_file_states() -> None:
    rows = "".join(f"{45 * (k == 0)},{45 * (k == 1)},{45 * (k == 2)},1,0,0\n" for k in range(3))
    content = f"# unit: g\n# triad: m\nmx,my,mz,ax,ay,az\n{rows}"
    assert import_sheet(laid(content), None).table.content == "fields"


TWO_SENSORS = "time,acc1_x,acc1_y,acc1_z,acc2_x,acc2_y,acc2_z,temp\n" + "".join(
    f"{0.01 * k:.2f},{x},{y},{z},{1.1 * x:.3f},{1.1 * y:.3f},{1.1 * z:.3f},20\n"
    for k, (x, y, z) in enumerate(np.repeat([*np.eye(3), *-np.eye(3)], 200, axis=0))
)


def test_a_second_sensor_in_the_same_columns_is_named_with_its_own_import() -> None:
    with pytest.raises(MissingColumn, match="The file has a second sensor, acc2_x, acc2_y, acc2_z:") as error:
        import_sheet(laid(TWO_SENSORS), None)
    commands = [line for line in str(error.value).splitlines() if line.startswith("    rig import")]
    sensors = []
    for command in commands:
        words = shlex.split(command)
        mapped = [ColumnMapping.parse(word) for before, word in pairwise(words) if before == "--column"]
        imported = import_sheet(laid(TWO_SENSORS), "positions", mapped)
        sensors.append(float(np.abs(imported.table.outputs).max()))
        (note,) = imported.notes
        assert f"acc{2 if len(sensors) == 1 else 1}_x" in note
        assert "damaged_lines" not in imported.settings
    assert sensors == pytest.approx([1.0, 1.1])


@pytest.mark.parametrize("others", ["vel1_x,vel1_y,vel1_z", "acc2_x,acc2_y,spare", "acc_raw_x,acc_raw_y,acc_raw_z"])
def test_other_columns_are_no_second_sensor(others: str) -> None:
    content = TWO_SENSORS.replace("acc2_x,acc2_y,acc2_z", others)
    columns = [ColumnMapping.parse(text) for text in ("t_s=time", "ax=acc1_x", "ay=acc1_y", "az=acc1_z")]
    assert import_sheet(laid(content), "positions", columns).notes == ()
