"""The bench file: what is refused, and how the message helps."""

from collections.abc import Callable
from datetime import date
from pathlib import Path

import pytest
import yaml

from drivers.transport import Address
from rig.bench import DEFAULT, Bench, drivers, read_bench
from rig.errors import BenchError
from rig.instruments.wiring import on_a_network, open_wires

ONE_INPUT = {"vx": 1, "vy": 1}
ALPHA = {"driver": "oriental_az", "url": "simulated"}


def test_the_simulated_rig_is_the_default() -> None:
    bench = read_bench()
    assert bench.simulated
    assert set(bench.instruments) == {"alpha", "beta", "adc", "oven", "level", "positioner"}
    assert bench.constants["sensor"] == "ADXL203"
    assert bench.constants["filter_corner_hz"] == 15.07


def test_a_bench_is_read_again_from_its_document() -> None:
    bench = read_bench()
    assert Bench.model_validate(bench.document()) == bench


CURVE = "serial: '63'\ndate: 2026-11-21\nnear: [[0, 0], [10, 1], [20, 2], [30, 3]]\n"


def test_a_curve_in_the_folder_of_the_bench_file_is_read(bench_file: Callable[..., Path]) -> None:
    path = bench_file({"d63": {"curve": "d63.yaml", "direction": -1}})
    (path.parent / "d63.yaml").write_text(CURVE)
    bench = read_bench(path)
    assert bench.d63 is not None
    assert (bench.d63.curve.serial, bench.d63.side) == ("63", "near")
    (path.parent / "d63.yaml").unlink()  # a run keeps the curve that it was made with
    assert Bench.model_validate(bench.document()) == bench


@pytest.mark.parametrize(
    ("d63", "said"),
    [
        (None, "key d63: this key is missing; the channel d63 needs its calibration curve"),
        ({"curve": "none.yaml"}, "key d63.curve: "),
        ({"curve": "d63.yaml", "side": "far"}, "key d63.side: the curve has no far side"),
        ({"curve": "simulated", "side": "nearer"}, "key d63.side: Input should be 'near' or 'far'"),
        ({"curve": "simulated", "sides": "far"}, "key d63.sides: no such key. Did you mean 'side'?"),
    ],
)
def test_a_displacement_sensor_without_its_curve_is_refused(
    d63: object, said: str, bench_file: Callable[..., Path]
) -> None:
    path = bench_file({"d63": d63})
    (path.parent / "d63.yaml").write_text(CURVE)
    with pytest.raises(BenchError) as error:
        read_bench(path)
    assert said in str(error.value)


def test_every_driver_is_found_by_its_file() -> None:
    assert {"oriental_az", "labjack_t7", "omega_cn7500"} <= set(drivers())
    assert not {"clock", "transport", "world"} & set(drivers())


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"schema": "rig.model/1"}, "is a model file, not a bench file; give it with --model"),
        ({"sensr": {}}, "key sensr: no such key. Did you mean 'sensor'?"),
        ({"sensor": {"gravity": 9.8}}, "key sensor.gravity: no such key. Did you mean 'gravity_m_s2'?"),
        ({"limits": {"temprature_c": [0, 1]}}, "key limits.temprature_c: no such key. Did you mean 'temperature_c'?"),
        ({"limits": {"temperature_c": [0]}}, "key limits.temperature_c.1: this key is missing"),
        ({"seed": "x"}, "key seed: Input should be a valid integer"),
        ({"instruments": {"alhpa": ALPHA}}, "key instruments.alhpa: no such role. Did you mean 'alpha'?"),
        ({"instruments": {"alpha": {"driver": "x"}}}, "key instruments.alpha.url: this key is missing"),
        (
            {"instruments": {"alpha": ALPHA | {"drivr": 1}}},
            "key instruments.alpha.drivr: no such key. Did you mean 'driver'?",
        ),
        (
            {"instruments": {"alpha": ALPHA | {"driver": "oriental"}}},
            "no driver 'oriental'. Did you mean 'oriental_az'?",
        ),
        (
            {"instruments": {"alpha": ALPHA | {"settings": {"sped_deg_s": 1}}}},
            "key instruments.alpha.settings.sped_deg_s: no such key. Did you mean 'speed_deg_s'?",
        ),
        (
            {"instruments": {"alpha": ALPHA | {"settings": {"speed_deg_s": "fast"}}}},
            "key instruments.alpha.settings.speed_deg_s: Input should be a valid number",
        ),
        ({"instruments": {"alpha": ALPHA | {"error_table": [[0, 0.1]]}}}, "alpha.error_table.0.2: this key is missing"),
        ({"instruments": {"alpha": ALPHA | {"error_table": "a.csv"}}}, "a.csv: cannot be read: No such file"),
        (
            {"instruments": {"alpha": ALPHA | {"error_table": [[0, 0, 0.1], [10, -11, 0.1]]}}},
            "key instruments.alpha.error_table: with this error table the stage turns backwards after 0 deg",
        ),
        (
            {"instruments": {"oven": {"driver": "omega_cn7500", "url": "simulated", "error_table": [[0, 0, 0.1]]}}},
            "key instruments.oven.error_table: only alpha and beta have an error table",
        ),
        (
            {"instruments": {"alpha": ALPHA | {"certificate": {"nummer": "1", "due": "2027-03-01"}}}},
            "key instruments.alpha.certificate.nummer: no such key. Did you mean 'number'?",
        ),
        ({"certificates": {"d63": {"number": 1, "due": "soon"}}}, "key certificates.d63.due: Input should be a valid"),
        (
            {"sensor": {"gravity_m_s2": 98}},
            "key sensor.gravity_m_s2: is 98, which is not gravity at any place on Earth",
        ),
        (
            {"sensor": {"gravity_m_s2": 1}},
            "key sensor.gravity_m_s2: is 1, which is not gravity at any place on Earth",
        ),
        ({"sensor": {"gravity_m_s2": "9,80131"}}, "is '9,80131'; write 9.80131, with a decimal point"),
        ({"sensor": {"filter_corner_hz": 0}}, "key sensor.filter_corner_hz: the corner is 0 Hz; give one above 0"),
        ({"limits": {"temperature_c": [60, 20]}}, "key limits.temperature_c: [60, 20] is not a range; give the lowest"),
        ({"limits": {"overrun_deg": -1}}, "key limits.overrun_deg: the distance is -1 deg; give 0 or more"),
        ({"limits": {"level_deg": 0}}, "key limits.level_deg: the limit is 0 deg; give a tilt above 0"),
        ({"limits": {"results": {"gap": [2, 1]}}}, "key limits.results.gap: [2, 1] is not a range"),
        ({"limits": {"results": {"gap": -1}}}, "key limits.results.gap: the limit is -1"),
        (
            {"limits": {"results": {"noise-rsm-x": 0.001}}},
            "key limits.results.noise-rsm-x: no procedure has such a result. Did you mean 'noise-rms-x'?",
        ),
        (
            {"instruments": {"adc": {"driver": "labjack_t7", "url": "simulated", "settings": {"channels": ONE_INPUT}}}},
            "key instruments.adc.settings.channels: vx and vy are both input 1; give each its own",
        ),
        ({"world": {"sensr": {}}}, "'sensr' of the simulated world. Did you mean 'sensor'?"),
        ({"folders": {"effects": "nowhere"}}, "key folders.effects: there is no folder"),
        ("- a list", "the bench file is not a mapping"),
        ("seed: [", "the bench file is not YAML"),
    ],
)
def test_a_fault_of_the_bench_file_is_named_with_its_key(
    bench_file: Callable[..., Path], changes: dict[str, object] | str, said: str
) -> None:
    path = bench_file(changes)
    with pytest.raises(BenchError) as error:
        read_bench(path)
    assert str(error.value).startswith(str(path))
    assert said in str(error.value)


def test_results_of_the_users_own_procedures_can_have_limits(bench_file: Callable[..., Path], tmp_path: Path) -> None:
    path = bench_file({"limits": {"results": {"mass": 2.0}}, "folders": {"procedures": str(tmp_path)}})
    assert read_bench(path).result_limits["mass"] == 2.0


def test_a_misspelt_key_is_named_before_the_missing_key(golden, bench_file: Callable[..., Path]) -> None:
    with golden.refused(BenchError):
        read_bench(bench_file("intruments: {}"))


def test_a_missing_bench_file_is_named(golden, tmp_path: Path) -> None:
    with golden.refused(BenchError):
        read_bench(tmp_path / "bench.yaml")


LINE = "serial:/dev/ttyUSB0?baud=115200&parity=E"
OVEN = {"driver": "omega_cn7500", "url": LINE}
POSITIONER = {"driver": "pi_e727", "url": "tcp://192.168.1.41:50000"}
T7 = {"driver": "labjack_t7", "url": "tcp://192.168.1.40:502"}


def on(url: str, unit: int | None = None, driver: str = "oriental_az") -> dict[str, object]:
    return {"driver": driver, "url": url} | ({} if unit is None else {"unit": unit})


@pytest.mark.parametrize(
    ("instruments", "says"),
    [
        ({"alpha": on(LINE, 1), "beta": on(LINE)}, f"beta.unit: alpha and beta are both unit 1 at {LINE}, so both"),
        ({"alpha": on("simulated"), "beta": on("simulated")}, "beta.unit: alpha and beta are both unit 1 at simulated"),
        ({"alpha": on(LINE, 2), "beta": on(LINE, 3), "oven": OVEN | {"unit": 3}}, "oven.unit: beta and oven are both"),
        (
            {"alpha": on("rtu+tcp://LOCALHOST:4001"), "beta": on("rtu+tcp://127.0.0.1:4001")},
            "are both unit 1 at rtu+tcp://LOCALHOST:4001 (also written rtu+tcp://127.0.0.1:4001), so both",
        ),
        ({"alpha": on("rtu+tcp://[::1]:4001"), "beta": on("tcp://localhost:4001")}, "are both unit 1 at"),
        ({"alpha": on("serial:/dev/tty"), "beta": on("serial:/dev/../dev//tty?baud=9600")}, "are both unit 1 at"),
        ({"alpha": on("serial:/dev/tty"), "beta": on("serial:/dev//tty", 2)}, "write the same address for both"),
        ({"alpha": on(POSITIONER["url"], 2), "positioner": POSITIONER}, "but positioner has no unit number"),
        ({"alpha": on(LINE, 0)}, "alpha.unit: unit 0 is not possible on a serial line; give 1 to 247"),
        ({"adc": T7 | {"stream_url": "tcp://a:4001"}, "alpha": on("tcp://A:4001")}, "but adc.stream_url has no unit"),
    ],
)
def test_units_that_cannot_share_a_line_are_refused(
    bench_file: Callable[..., Path], instruments: dict[str, object], says: str
) -> None:
    with pytest.raises(BenchError) as error:
        read_bench(bench_file({"instruments": instruments}))
    assert "key instruments." in str(error.value)
    assert says in str(error.value)


def test_a_link_to_a_serial_line_is_the_line(bench_file: Callable[..., Path], tmp_path: Path) -> None:
    (tmp_path / "stages").symlink_to("/dev/ttyUSB0")
    instruments = {"alpha": on("serial:/dev/ttyUSB0"), "beta": on(f"serial:{tmp_path}/stages")}
    with pytest.raises(BenchError, match="alpha and beta are both unit 1"):
        read_bench(bench_file({"instruments": instruments}))


@pytest.mark.parametrize(
    "instruments",
    [
        {"alpha": on(LINE, 1), "beta": on(LINE, 2), "oven": OVEN | {"unit": 3}},
        {"alpha": on("rtu+tcp://converter:4001"), "beta": on("rtu+tcp://converter:4002")},
        {"alpha": on("simulated"), "oven": OVEN | {"url": "simulated"}},
        {"alpha": on("simulated:pty:"), "beta": on("simulated")},
        {role: on("person", driver="manual_stage") for role in ("alpha", "beta")},
        {role: on("simulated", driver="manual_stage") for role in ("alpha", "beta")},
    ],
)
def test_instruments_that_may_share_a_line_or_a_person(
    bench_file: Callable[..., Path], instruments: dict[str, object]
) -> None:
    assert set(read_bench(bench_file({"instruments": instruments})).instruments) == set(instruments)


def test_a_recorded_bench_with_two_roles_on_one_unit_is_not_connected(golden) -> None:
    twice = {role: part.model_copy(update={"unit": 1}) for role, part in read_bench().instruments.items()}
    with (
        golden.refused(BenchError),
        open_wires(read_bench().model_copy(update={"instruments": twice})),
    ):
        pass


def test_folders_are_relative_to_the_file(bench_file: Callable[..., Path], tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    assert read_bench(bench_file({"folders": {"procedures": "mine"}})).folders.procedures == tmp_path / "mine"


def test_a_real_address_is_passed_on_and_a_simulated_one_may_say_where_it_listens(
    bench_file: Callable[..., Path],
) -> None:
    instruments = yaml.safe_load(DEFAULT.read_text())["instruments"]
    instruments["alpha"] |= {"url": "serial:/dev/ttyUSB0?parity=E", "unit": 3}
    instruments["adc"] |= {"url": "simulated:tcp://127.0.0.1:5022"}
    bench = read_bench(bench_file({"instruments": instruments}))
    assert bench.instruments["alpha"].address == Address("serial:/dev/ttyUSB0?parity=E", 3)
    assert bench.instruments["adc"].listen == "tcp://127.0.0.1:5022"
    assert bench.instruments["oven"].listen is None
    assert not bench.simulated


def test_an_error_table_in_the_folder_of_the_bench_file_becomes_a_part_of_the_bench(
    bench_file: Callable[..., Path], tmp_path: Path
) -> None:
    (tmp_path / "alpha.csv").write_text("angle_deg,error_deg,std_deg\n0,0.01,0.001\n30,0.02,0.001\n")
    certificate = {"number": 17, "due": date(2027, 3, 1)}
    alpha = ALPHA | {"error_table": "alpha.csv", "certificate": certificate}
    bench = read_bench(bench_file({"instruments": {"alpha": alpha}, "certificates": {"hand level": certificate}}))
    assert bench.instruments["alpha"].error_table == ((0.0, 0.01, 0.001), (30.0, 0.02, 0.001))
    assert bench.instruments["alpha"].certificate == bench.certificates["hand level"]
    (tmp_path / "alpha.csv").unlink()
    assert Bench.model_validate(bench.document()) == bench


def test_the_configuration_is_that_of_procedure_settings_and_bench() -> None:
    bench = read_bench()
    same = bench.configuration("sweep", {"step_deg": 10.0})
    assert same == read_bench().configuration("sweep", {"step_deg": 10.0})
    others = [("sweep", {"step_deg": 5.0}), ("soak", {"step_deg": 10.0})]
    assert same not in [bench.configuration(name, settings) for name, settings in others]
    assert same != bench.model_copy(update={"seed": 2}).configuration("sweep", {"step_deg": 10.0})


@pytest.mark.parametrize(
    ("url", "shared"),
    [
        ("tcp://192.168.1.40:502", True),
        ("rtu+tcp://converter:4001", True),
        ("visa:TCPIP0::10.0.0.7::INSTR", True),
        ("ca:13IDC:m1", True),
        ("ca://localhost:5064/13IDC:m1", False),
        ("tcp://127.0.0.1:502", False),
        ("rtu+tcp://localhost:4001", False),
        ("serial:/dev/ttyUSB0?baud=115200", False),
        ("visa:USB0::0x2A8D::0x0101::MY1::INSTR", False),
        ("simulated", False),
    ],
)
def test_instruments_that_other_computers_can_reach_are_known(url: str, shared: bool) -> None:
    bench = read_bench()
    parts = {**bench.instruments, "oven": bench.instruments["oven"].model_copy(update={"url": url})}
    assert on_a_network(bench.model_copy(update={"instruments": parts})) == (["oven"] if shared else [])
