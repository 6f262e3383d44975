"""The simulated E-727: its answers as PI's client wants them, and the positioner driver on it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import SimulatedClock
from drivers.errors import LinkTimeout, Refused
from drivers.pi_e727 import twin as pi_e727_twin
from drivers.pi_e727.driver import Positioner, Settings, connect
from drivers.transport import Links
from drivers.transport.link import Link, open_link
from drivers.transport.server import Server
from tests.drivers.conftest import SmallWorld

SINE = "WAV 2 X SIN_P 2000 20 10 2000 0 1000"  # 10 Hz at table rate 1
READY_TO_PLAY = ("SVO 2 1", "MOV 2 10", SINE, "WSL 2 2")
Ask = Callable[[str], str]


@pytest.fixture
def server(small_world: Any, clock: SimulatedClock) -> Iterator[Server]:
    served = pi_e727_twin.serve(small_world, {"positioner": (1, Settings())})
    clock.attach(served)
    yield served
    served.close()


@pytest.fixture
def link(server: Server, clock: SimulatedClock) -> Iterator[Link]:
    opened = open_link(server.url, clock)
    yield opened
    opened.close()


@pytest.fixture
def ask(link: Link) -> Ask:
    """Send a line, or one byte without LF, and give what comes back within 50 ms."""

    def exchange(command: str) -> str:
        link.write((command if command < " " else command + "\n").encode())
        return link.read(0.05).decode("latin-1")

    return exchange


@pytest.fixture
def positioner(server: Server, clock: SimulatedClock) -> Iterator[Positioner]:
    links = Links(clock)
    connected = connect(server.addresses["positioner"], links, Settings(), "positioner")
    connected.servo(True)
    yield connected
    links.close()


def error(ask: Ask, *commands: str) -> int:
    """The error after commands that have no answer."""
    assert [ask(command) for command in commands] == [""] * len(commands)
    return int(ask("ERR?"))


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("CSV?", "2.0\n"),
        ("SAI?", "1 \n2 \n3\n"),
        ("SAI? ALL", "1 \n2 \n3\n"),
        ("TMX? 1 3", "1=100.000000 \n3=100.000000\n"),
        ("SVO?", "1=0 \n2=0 \n3=0\n"),
        ("\x05", "0\n"),
        ("\x07", "\xb1\n"),
        ("\x09", "0\n"),
        ("SPA? 1 234881536", "1 234881536=5.00000000e-05\n"),
        ("SPA? 1 0x0E000200", "1 0x0E000200=5.00000000e-05\n"),
        ("WTR?", "1=1 0 \n2=1 0 \n3=1 0\n"),
        ("ERR?", "0\n"),
    ],
)
def test_the_twin_answers_as_the_manual_says(ask: Ask, question: str, answer: str) -> None:
    assert ask(question) == answer


def test_it_has_four_fields_of_identity_and_lists_its_commands(ask: Ask) -> None:
    fields = ask("*IDN?").split(",")
    assert len(fields) == 4
    assert fields[1].strip() == "E-727"
    known = [line.strip() for line in ask("HLP?").splitlines()]
    assert {"SPA", "SPA?", "HPA?", "MOV", "WGO", "DRR?", "*IDN?"} <= set(known)


@pytest.mark.parametrize(
    ("commands", "code"),
    [
        (["MOV 1 ten"], 1),
        (["BEEP 1"], 2),
        (["MOV 1 10"], 5),
        (["SVO 1 1", "MOV 1 100.1"], 7),
        (["SVO 1 1", "MOV 1 nan"], 7),
        (["SVO 1 1 2 1", "MOV 1 10 2 -1"], 7),
        (["SVO 4 1"], 15),
        (["SVO 1 2"], 17),
        (["WAV 1 X SIN_P 2000 20 10 2000 0 999"], 17),
        (["WAV 1 X RAMP 2000 20 10 2000 0 1000"], 17),
        (["WGO 4 1"], 23),
        (["MOV 1"], 24),
        (["MOV"], 24),
        (["WAV 1 X SIN_P 2000"], 24),
        (["SPA? 1 0x7"], 54),
        (["WAV 1 X SIN_P 200000 9 9 200000 0 100000", "WAV 2 X SIN_P 100000 9 9 100000 0 50000"], 67),
        ([*READY_TO_PLAY, "WGO 2 1", "MOV 2 10"], 73),
        (["SVO 1 1", "WGO 1 1"], 75),
        (["WSL 2 2", SINE, "WGO 2 1"], 5),
        (["SVO 1 1", "WAV 1 X SIN_P 2000 20 90 2000 0 1000", "WSL 1 1", "WGO 1 1"], 7),
        (["\x18"], 10),
    ],
)
def test_errors_have_the_controller_s_numbers_and_are_told_once(ask: Ask, commands: list[str], code: int) -> None:
    assert error(ask, *commands) == code
    assert ask("ERR?") == "0\n"


def test_a_move_beyond_the_range_moves_no_axis(ask: Ask, clock: SimulatedClock) -> None:
    assert error(ask, "SVO 1 1 2 1", "MOV 1 10 2 120") == 7
    clock.sleep(1)
    assert float(ask("POS? 1").partition("=")[2]) == pytest.approx(0.5, abs=0.01)
    assert error(ask, "MOV 1 10 2 20") == 0
    assert ask("\x05") == "3\n"
    clock.sleep(1)
    assert ask("ONT?") == "1=1 \n2=1 \n3=0\n"
    assert float(ask("POS? 2").partition("=")[2]) == pytest.approx(20.0, abs=0.01)


def test_a_wave_of_three_cycles_takes_300_ms(ask: Ask, clock: SimulatedClock) -> None:
    assert error(ask, *READY_TO_PLAY) == 0
    clock.sleep(0.2)
    assert error(ask, "WGC 2 3", "WGO 2 1") == 0
    assert (ask("\x09"), ask("WGO? 2"), ask("\x05")) == ("2\n", "2=1\n", "2\n")
    clock.sleep(0.3)
    assert (ask("\x09"), ask("WGO? 2")) == ("0\n", "2=0\n")
    assert float(ask("POS? 2").partition("=")[2]) == pytest.approx(10.0, abs=0.5)


def test_a_wave_ends_at_once_when_it_is_told_to(ask: Ask, clock: SimulatedClock) -> None:
    assert error(ask, *READY_TO_PLAY, "WGO 2 1") == 0
    clock.sleep(0.123)
    assert error(ask, "WGO 2 0") == 0
    assert ask("\x09") == "0\n"
    assert error(ask, "MOV 2 50") == 0


HELP = pi_e727_twin.Controller(SmallWorld(), Settings()).answer("HLP?", 0.0) or ""
VERBS = [*(line.strip() for line in HELP.splitlines()), " "]
WORDS = ["0", "1", "2", "3", "X", "SIN_P", "2000", "1000", "-5", "1e400", "nan", "0x10", "9" * 30, "\xb5"]


@given(st.lists(st.tuples(st.sampled_from(VERBS), st.lists(st.sampled_from(WORDS), max_size=9)), max_size=12))
def test_any_sequence_of_commands_gets_whole_answers(commands: list[tuple[str, list[str]]]) -> None:
    controller = pi_e727_twin.Controller(SmallWorld(), Settings())
    for k, (verb, words) in enumerate([("SVO", ["1", "1", "2", "1"]), *commands]):
        controller.advance(0.01 * k)
        answer = controller.answer(" ".join([verb, *words]), 0.01 * k)
        assert answer is None or answer.endswith("\n")
    assert int(controller.answer("ERR?", 1.0) or "") in range(100)


def test_half_a_line_waits_for_its_end(link: Link) -> None:
    link.write(b"CS")
    assert link.read(0.1) == b""
    link.write(b"V?\n")
    assert link.read(0.1) == b"2.0\n"


def test_the_recorder_starts_with_the_wave_and_comes_in_one_answer(ask: Ask, clock: SimulatedClock) -> None:
    assert error(ask, *READY_TO_PLAY, "DRC 1 2 2 2 2 1", "DRT 0 0 0", "RTR 20") == 0
    clock.sleep(0.2)
    assert ask("DRL? 1") == "1=0\n"
    assert error(ask, "WGO 2 1") == 0
    clock.sleep(0.2)
    answer = ask("DRR? 1 3 2 1")
    header, _, rows = answer.partition("# END_HEADER \n")
    assert "# DIM = 2 \n" in header
    assert "# SAMPLE_TIME = 0.001 \n" in header
    assert "# NDATA = 3 \n" in header
    assert rows.count(" \n") == 2
    assert rows.split()[0] == "10.000000"  # the command's first place


@pytest.mark.parametrize(("trigger", "command"), [("1", "MOV 2 40"), ("4", "RTR?")])
def test_other_triggers_start_the_recorder_as_well(ask: Ask, clock: SimulatedClock, trigger: str, command: str) -> None:
    assert error(ask, "SVO 2 1", "DRC 1 2 3", f"DRT 0 {trigger} 0") == 0
    ask(command)
    clock.sleep(0.01)
    assert int(ask("DRL? 1").partition("=")[2]) >= 200


def test_the_driver_moves_and_oscillates(positioner: Positioner, clock: SimulatedClock, small_world: Any) -> None:
    positioner.move_to("x", 40.0)
    assert positioner.position_um("x") == pytest.approx(40.0, abs=0.01)
    started = positioner.oscillate("x", peak_to_peak_um=60.0, frequency_hz=10.0, centre_um=50.0)
    clock.sleep(1.0)
    record = positioner.recorded("x")
    times = record.interval_s * np.arange(len(record.position_um))
    steady = times > 0.2
    waves = np.exp(-2j * np.pi * started * times[steady][:800])
    assert record.interval_s == pytest.approx(1e-3)
    assert 2 * abs(np.mean(record.position_um[steady][:800] * waves)) == pytest.approx(30.0, rel=0.01)
    assert record.position_um[steady][:800].mean() == pytest.approx(50.0, abs=0.05)
    assert small_world.positioner_um("y", clock.now())[0] == pytest.approx(0.5, abs=0.01)


def test_after_a_stop_in_mid_wave_nothing_moves(
    positioner: Positioner, clock: SimulatedClock, small_world: Any
) -> None:
    positioner.oscillate("x", peak_to_peak_um=60.0, frequency_hz=10.0, centre_um=50.0)
    clock.sleep(0.125)  # at its fastest
    positioner.stop()
    times = clock.now() + np.linspace(0, 10, 1001)
    assert np.ptp(small_world.positioner_um("x", times)) < 0.02  # the sensor's noise
    positioner.move_to("x", 50.0)  # and it can be used again


def test_axes_have_the_names_of_the_bench(small_world: Any, clock: SimulatedClock) -> None:
    settings, links = Settings(axes={"z": "C", "x": "A"}), Links(clock)
    served = pi_e727_twin.serve(small_world, {"positioner": (1, settings)})
    clock.attach(served)
    positioner = connect(served.addresses["positioner"], links, settings, "positioner")
    positioner.servo(True)
    positioner.oscillate("x", peak_to_peak_um=20.0, frequency_hz=5.0, centre_um=50.0)
    clock.sleep(0.4)
    spans = {axis: np.ptp(small_world.positioner_um(axis, clock.now() + np.linspace(0, 0.2, 50))) for axis in "xyz"}
    assert (spans["x"] > 19, spans["y"] < 0.1, spans["z"] < 0.1) == (True, True, True)
    assert np.ptp(positioner.recorded("x").position_um) > 19
    links.close()
    served.close()


def test_it_serves_a_serial_line_as_well(small_world: Any, clock: SimulatedClock) -> None:
    served, links = pi_e727_twin.serve(small_world, {"positioner": (1, Settings())}, "pty:"), Links(clock)
    clock.attach(served)
    positioner = connect(served.addresses["positioner"], links, Settings(), "positioner")
    assert all(check.ok for check in positioner.self_test())
    positioner.servo(True)
    positioner.move_to("z", 30.0)
    links.close()
    served.close()


def test_a_stop_is_safe_in_any_state(positioner: Positioner) -> None:
    for _ in range(2):
        positioner.stop()
    positioner.servo(False)
    positioner.stop()


def test_a_move_without_servo_says_what_to_do(positioner: Positioner) -> None:
    positioner.servo(False)
    with pytest.raises(Refused, match=r"positioner: MOV 1 .*: error 5.*Switch the servo on"):
        positioner.move_to("x", 50.0)


def test_a_controller_that_falls_silent(server: Server, positioner: Positioner, clock: SimulatedClock) -> None:
    server._ports[0].answer = lambda connection, now_s: connection.inbox.clear()  # the twin hangs
    started = clock.now()
    with pytest.raises(LinkTimeout, match=r"positioner: no answer to ERR\?"):
        positioner.move_to("x", 50.0)
    with pytest.raises(LinkTimeout, match=r"positioner: no answer"):
        positioner.stop()
    assert clock.now() - started < 5


def test_a_restarted_twin_swings_on(
    server: Server, positioner: Positioner, small_world: Any, clock: SimulatedClock
) -> None:
    positioner.oscillate("x", peak_to_peak_um=60.0, frequency_hz=10.0, centre_um=50.0)
    clock.sleep(0.5)
    kept = json.dumps({"twin": server.state(), "world": small_world.state(), "clock": clock.now()})
    expected = small_world.positioner_um("x", clock.now() + np.linspace(0, 1, 11)).tolist()
    positioner.stop()

    state = json.loads(kept)
    small_world.restore(state["world"])
    server.restore(state["twin"])
    clock.restore(state["clock"])
    assert json.dumps({"twin": server.state(), "world": small_world.state(), "clock": clock.now()}) == kept
    assert small_world.positioner_um("x", clock.now() + np.linspace(0, 1, 11)).tolist() == expected
    with pytest.raises(Refused, match="no move while a wave runs"):
        positioner.move_to("x", 50.0)
    positioner.stop()
    positioner.move_to("x", 50.0)
