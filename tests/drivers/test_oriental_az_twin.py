"""The simulated drive: its bytes as the manual has them, and the stage driver on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from drivers.clock import SimulatedClock
from drivers.errors import LimitError, LinkTimeout, NotSettled, StageLost
from drivers.oriental_az import registers as az
from drivers.oriental_az import twin as oriental_az_twin
from drivers.oriental_az.driver import Settings, connect
from drivers.transport import Address
from drivers.transport.link import open_link
from tests.drivers.conftest import bytes_exchanged

MOVE = (
    "01 10 00 58 00 10 20 00 00 00 00 00 00 00 01 00 00 21 34 00 00 07 D0 00 00 05 DC 00 00 05 DC "
    "00 00 03 E8 00 00 00 01 E3 43"
)
WITHOUT_SPEED = (
    "01 10 00 58 00 10 20 00 00 00 00 00 00 00 01 00 00 21 34 00 00 00 00 00 00 05 DC 00 00 05 DC "
    "00 00 03 E8 00 00 00 01 0F CF"
)
TAKEN = "01 10 00 58 00 10 40 16"
ASK_ALARM = "01 03 00 80 00 02 C5 E3"
HOME_ON, INPUTS_OFF = "01 06 00 7D 00 10 18 1E", "01 06 00 7D 00 00 19 D2"
Ask = Callable[[str], str]


@pytest.fixture
def ask(small_world: Any, clock: SimulatedClock) -> Iterator[Ask]:
    """Send hexadecimal bytes to a bus with unit 1 (100 steps/deg, standing at 7 deg) and give the answer's."""
    server = oriental_az_twin.serve(small_world, {"alpha": (1, Settings(steps_per_turn=36000))})
    with bytes_exchanged(server, clock) as exchange:
        yield exchange


def test_the_position_register_counts_steps(ask: Ask) -> None:
    assert ask("01 03 00 CC 00 02 04 34").startswith("01 03 04 00 00 02 BC")


def test_an_absolute_move_before_homing_is_alarm_4a(ask: Ask) -> None:
    assert ask(MOVE) == TAKEN
    assert ask(ASK_ALARM) == "01 03 04 00 00 00 4A 7B C4"


def test_an_alarm_is_reset_and_a_homed_stage_moves(ask: Ask, clock: SimulatedClock) -> None:
    ask(MOVE)
    ask("01 10 01 80 00 02 04 00 00 00 00 F6 5F")
    ask("01 10 01 80 00 02 04 00 00 00 01 37 9F")
    assert ask(ASK_ALARM) == "01 03 04 00 00 00 00 FA 33"
    assert ask(HOME_ON) == HOME_ON
    assert ask(INPUTS_OFF) == INPUTS_OFF
    clock.sleep(2.0)
    assert ask("01 03 00 7F 00 03 34 13") == "01 03 06 40 30 00 00 00 00 6F B1"  # HOME-END, READY, IN-POS
    assert ask(MOVE) == TAKEN
    assert ask("01 03 00 7F 00 03 34 13").startswith("01 03 06 20 10")  # MOVE, HOME-END
    clock.sleep(10.0)
    assert ask("01 03 00 CC 00 02 04 34") == "01 03 04 00 00 21 34 E3 B4"


def test_a_move_without_speed_is_alarm_70(ask: Ask) -> None:
    assert ask(WITHOUT_SPEED) == TAKEN
    assert ask(ASK_ALARM) == "01 03 04 00 00 00 70 FB D7"


def test_write_and_read_in_one_exchange(ask: Ask) -> None:
    assert ask("01 17 00 7F 00 01 00 7D 00 01 02 00 20 6D 40").startswith("01 17 02 40 20")  # IN-POS, READY


def test_a_function_it_does_not_know_is_exception_1(ask: Ask) -> None:
    assert ask("01 04 00 7F 00 01 00 12") == "01 84 01 82 C0"


def test_an_absent_unit_does_not_answer(ask: Ask) -> None:
    assert ask("09 03 00 7F 00 01 B4 9A") == ""


def test_a_wrong_checksum_is_met_with_silence(ask: Ask) -> None:
    assert ask("01 03 00 80 00 02 C5 E4") == ""
    assert ask(ASK_ALARM) == "01 03 04 00 00 00 00 FA 33"


def test_a_request_may_come_in_pieces(small_world: Any, clock: SimulatedClock) -> None:
    server = oriental_az_twin.serve(small_world, {"alpha": (1, Settings())})
    clock.attach(server)
    link = open_link(server.url, clock)
    link.write(bytes.fromhex("01 03 00"))
    assert link.read(0.01) == b""
    link.write(bytes.fromhex("80 00 02 C5 E3"))
    assert link.read(0.2).hex(" ").upper() == "01 03 04 00 00 00 00 FA 33"
    link.close()
    server.close()


def test_half_a_request_is_forgotten(ask: Ask) -> None:
    assert ask("01 03 00") == ""
    assert ask(ASK_ALARM) == "01 03 04 00 00 00 00 FA 33"


def test_an_exchange_costs_its_line_time(ask: Ask, clock: SimulatedClock) -> None:
    ask(ASK_ALARM)
    characters = 17 * 10 / 115200
    assert clock.now() == pytest.approx(characters + 2 * 1.75e-3 + oriental_az_twin.THINKING_S)


# The driver on it.


def test_a_stage_must_be_homed_before_it_moves(bench: Any) -> None:
    assert not bench.alpha.referenced()
    with pytest.raises(StageLost, match="alpha: the position is unknown"):
        bench.alpha.move_to(10.0)
    bench.alpha.home()
    assert bench.alpha.referenced()
    assert bench.alpha.angle_deg() == 0.0


def test_a_move_ends_where_it_should_after_as_long_as_it_takes(bench: Any) -> None:
    bench.alpha.home()
    started = bench.clock.now()
    bench.alpha.move_to(90.0)
    assert bench.alpha.angle_deg() == 90.0
    assert bench.clock.now() - started == pytest.approx(90 / 20 + 20 / 40, abs=0.1)


def test_where_it_stands_already_it_does_not_turn_again(bench: Any) -> None:
    bench.alpha.home()
    bench.alpha.move_to(90.0)
    started = bench.clock.now()
    bench.alpha.move_to(90.0)
    assert bench.clock.now() - started < 0.03  # two exchanges
    assert not bench.alpha.start(90.0)
    bench.alpha.wait()


def test_an_angle_that_it_only_seems_to_have_is_no_arrival(bench: Any) -> None:
    """Before homing nobody knows where zero is."""
    assert bench.beta.angle_deg() == 0.0
    with pytest.raises(StageLost):
        bench.beta.move_to(0.0)


def test_both_stages_of_a_bus_turn_at_once(bench: Any) -> None:
    bench.alpha.home()
    bench.beta.home()
    started = bench.clock.now()
    bench.alpha.start(45.0)
    bench.beta.start(-90.0)
    bench.alpha.wait()
    bench.beta.wait()
    assert (bench.alpha.angle_deg(), bench.beta.angle_deg()) == (45.0, -90.0)
    assert bench.clock.now() - started < 6.0


def test_a_stop_ends_a_move_on_the_way(bench: Any) -> None:
    bench.alpha.home()
    bench.alpha.start(90.0)
    bench.clock.sleep(1.0)
    bench.alpha.stop()
    assert 10.0 < bench.alpha.angle_deg() < 30.0
    with pytest.raises(NotSettled, match=r"instead of 90.000 deg"):
        bench.alpha.wait()
    bench.alpha.move_to(5.0)
    assert bench.alpha.angle_deg() == pytest.approx(5.0)


def test_a_homing_that_is_stopped_sets_no_coordinates(bench: Any) -> None:
    bench.alpha.home()
    bench.alpha.move_to(90.0)
    bench.alpha._unit.write(az.INPUTS, az.ZHOME)
    bench.clock.sleep(1.0)
    bench.alpha.stop()
    assert not bench.alpha.referenced()


def test_a_limit_is_kept_without_a_word_on_the_wire(bench: Any) -> None:
    before = bench.clock.now()
    with pytest.raises(LimitError):
        bench.alpha.move_to(401.0)
    assert bench.clock.now() == before


def test_a_stage_that_is_not_there_is_named(bench: Any) -> None:
    absent = connect(Address(bench.servers["bus"].url, 3), bench.links, Settings(), "gamma")
    with pytest.raises(LinkTimeout, match="gamma: reading register 0x007F"):
        absent.move_to(0.0)


def test_the_self_test_says_what_is_to_be_done(bench: Any) -> None:
    assert {check.name: check.detail for check in bench.alpha.self_test()}["coordinates"] == "not set: home first"
    bench.alpha.home()
    assert {check.name: check.detail for check in bench.alpha.self_test()}["coordinates"] == "set"
    assert all(check.ok for check in bench.alpha.self_test())
