"""The E-727 driver's bytes: GCS 2.0 written out as text, with the ends of lines that PI's own client wants."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from drivers.clock import SimulatedClock
from drivers.errors import BadFrame, LimitError, LinkTimeout, NotSettled, Refused, StreamError
from drivers.instrument import Identity
from drivers.pi_e727 import driver as pi_e727
from drivers.pi_e727.driver import Positioner, Settings
from drivers.transport import Address, Links

SETTINGS = Settings(limits_um=(5.0, 95.0), settle_um=0.02)
NO_ERROR = ("ERR?\n", "0\n")
CYCLE = ("SPA? 1 234881536\n", "1 0xE000200=5.00000000e-05\n")  # parameter 0x0E000200: 50 us
TCP = "tcp://127.0.0.1:0"
Positioners = Callable[..., Positioner]


def done(command: str) -> list[tuple[str, str]]:
    """A command that is silently obeyed."""
    return [(command, ""), NO_ERROR]


def told(question: str, answer: str) -> list[tuple[str, str]]:
    return [(question, answer), NO_ERROR]


@pytest.fixture
def positioner(script: Callable[..., Address], links: Links) -> Positioners:
    """The driver on a controller that expects these exchanges, after the one in which it forgets an old error."""

    def start(*exchanges: tuple[str, str], settings: Settings = SETTINGS) -> Positioner:
        hexadecimal = [
            (ask.encode("latin-1").hex(" ").upper(), answer.encode("latin-1").hex()) for ask, answer in exchanges
        ]
        address = script([("45 52 52 3F 0A", "35 0A"), *hexadecimal], TCP)
        return pi_e727.connect(address, links, settings, "positioner")

    return start


def test_the_position_is_a_line_with_an_equals_sign(positioner: Positioners) -> None:
    assert positioner(*told("POS? 1\n", "1=40.001250\n")).position_um("x") == 40.00125
    assert positioner(*told("POS? 3\n", "3=-0.5\n")).position_um("z") == -0.5


def test_four_fields_tell_who_it_is(positioner: Positioners) -> None:
    answer = "(c)2015 Physik Instrumente (PI) GmbH & Co. KG, E-727.3SD, 0116045408, 12.43\n"
    assert positioner(*told("*IDN?\n", answer)).identify() == Identity("PI E-727.3SD", "0116045408", "12.43")


def test_lines_of_an_answer_end_with_space_and_lf_but_the_last(positioner: Positioners) -> None:
    checks = positioner(
        *told("*IDN?\n", "PI, E-727, 1, 2\n"),
        *told("SAI?\n", "1 \n2 \n3\n"),
        *told("TMN?\n", "1=0.0 \n2=0.0 \n3=10.0\n"),
        *told("TMX?\n", "1=100.0 \n2=100.0 \n3=100.0\n"),
        ("\x07", "\xb1\n"),
        *told("SVO?\n", "1=1 \n2=1 \n3=0\n"),
    ).self_test()
    assert {check.name: check.ok for check in checks} == {
        "model": True, "axes": True, "travel": False, "ready": True, "servo": True
    }  # fmt: skip
    assert checks[-1].detail == "off: z"


def test_the_servo_is_one_command_for_all_axes(positioner: Positioners) -> None:
    positioner(*done("SVO 1 1 2 1 3 1\n")).servo(True)


def test_a_move_waits_until_on_target_and_looks_where_it_is(positioner: Positioners) -> None:
    positioner(
        *done("MOV 1 40.000000\n"),
        *told("ONT? 1\n", "1=0\n"),
        *told("ONT? 1\n", "1=1\n"),
        *told("POS? 1\n", "1=40.0191\n"),
    ).move_to("x", 40.0)


def test_arrival_is_measured_not_assumed(positioner: Positioners) -> None:
    exchanges = [*done("MOV 1 40.000000\n"), *told("ONT? 1\n", "1=1\n"), *told("POS? 1\n", "1=40.0210\n")]
    with pytest.raises(NotSettled, match=r"positioner: x is at 40.021 um instead of 40.000 um"):
        positioner(*exchanges).move_to("x", 40.0)


@pytest.mark.parametrize("um", [4.99, 95.01, math.inf, math.nan])
def test_outside_its_limits_nothing_is_sent(positioner: Positioners, um: float) -> None:
    with pytest.raises(LimitError, match=r"positioner: x = .* outside its limits 5 .. 95 um; nothing was sent"):
        positioner().move_to("x", um)


def test_an_axis_that_the_bench_does_not_name(positioner: Positioners) -> None:
    with pytest.raises(LimitError, match=r"positioner: there is no axis 'X'; nothing was sent. Use one of x, y, z"):
        positioner().position_um("X")


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (5, "error 5, the servo is off, or the axis is not referenced. Switch the servo on"),
        (7, "error 7, the position is outside the travel. Set limits_um"),
        (10, "error 10, somebody stopped the axes"),
        (73, "error 73, no move while a wave runs. Stop the positioner"),
        (1234, "error 1234, an error that this program does not know. Look it up"),
    ],
)
def test_an_error_is_put_into_words(positioner: Positioners, code: int, words: str) -> None:
    with pytest.raises(Refused, match=rf"positioner: MOV 2 50.000000: {words}") as raised:
        positioner(("MOV 2 50.000000\n", ""), ("ERR?\n", f"{code}\n")).move_to("y", 50.0)
    assert raised.value.code == code


def test_a_question_that_is_refused_is_not_answered_but_explained(positioner: Positioners) -> None:
    with pytest.raises(Refused, match=r"positioner: POS\? 1: error 15, there is no such axis"):
        positioner(("POS? 1\n", ""), ("ERR?\n", "15\n")).position_um("x")


def test_silence_ends_and_names_the_instrument(positioner: Positioners, clock: SimulatedClock) -> None:
    silent = positioner(("POS? 1\n", ""), ("ERR?\n", ""))
    with pytest.raises(LinkTimeout, match=r"positioner: no answer to ERR\? within 1 s on tcp://"):
        silent.position_um("x")
    assert clock.now() < 4  # the answer to POS? may yet come late, and must not be taken for that to ERR?


@pytest.mark.parametrize(
    ("answer", "words"),
    [("1=4", r"the answer to POS\? 1 breaks off after 3 bytes"), ("1=4O.0\n", r"'4O.0' is not an answer to POS\? 1")],
)
def test_answers_that_are_no_number_are_refused(positioner: Positioners, answer: str, words: str) -> None:
    exchanges = [("POS? 1\n", answer)] if answer == "1=4" else told("POS? 1\n", answer)
    with pytest.raises(BadFrame, match=f"positioner: {words}"):
        positioner(*exchanges).position_um("x")


def test_an_oscillation_is_a_sine_that_the_generator_plays_and_the_recorder_follows(positioner: Positioners) -> None:
    swing = positioner(
        *told(*CYCLE),
        *done("MOV 2 20.000000\n"),
        *told("ONT? 2\n", "2=1\n"),
        *told("POS? 2\n", "2=20.0\n"),
        *done("WAV 2 X SIN_P 2000 60.000000 20.000000 2000 0 1000\n"),
        *done("WSL 2 2\n"),
        *done("WTR 2 1 1\n"),
        *done("WGC 2 0\n"),
        *done("DRC 2 2 2\n"),
        *done("RTR 20\n"),
        *done("DRT 2 0 0\n"),
        *done("WGO 2 1\n"),
    )
    assert swing.oscillate("y", peak_to_peak_um=60.0, frequency_hz=10.0, centre_um=50.0) == pytest.approx(10.0)


def test_a_slow_oscillation_holds_each_point_longer(positioner: Positioners) -> None:
    swing = positioner(
        *told(*CYCLE),
        *done("MOV 1 40.000000\n"),
        *told("ONT? 1\n", "1=1\n"),
        *told("POS? 1\n", "1=40.0\n"),
        *done("WAV 1 X SIN_P 4762 20.000000 40.000000 4762 0 2381\n"),  # 0.03 Hz: 666667 cycles of 50 us, 140 each
        *done("WSL 1 1\n"),
        *done("WTR 1 140 1\n"),
        *done("WGC 1 0\n"),
        *done("DRC 1 1 2\n"),
        *done("RTR 20\n"),
        *done("DRT 1 0 0\n"),
        *done("WGO 1 1\n"),
        settings=Settings(wave_points=4768),
    )
    really = swing.oscillate("x", peak_to_peak_um=20.0, frequency_hz=0.03, centre_um=50.0)
    assert really == pytest.approx(1 / (4762 * 140 * 50e-6), rel=1e-12)


@pytest.mark.parametrize(
    ("width_um", "centre_um", "words"),
    [
        (60.0, 30.0, r"x = 0 um is outside its limits"),
        (60.0, 70.0, r"x = 100 um is outside its limits"),
        (0.0, 50.0, r"an oscillation of 0 um is not possible"),
        (math.nan, 50.0, r"an oscillation of nan um is not possible"),
    ],
)
def test_an_oscillation_stays_within_the_limits(
    positioner: Positioners, width_um: float, centre_um: float, words: str
) -> None:
    with pytest.raises(LimitError, match=f"positioner: {words}.*nothing was sent"):
        positioner().oscillate("x", peak_to_peak_um=width_um, frequency_hz=10.0, centre_um=centre_um)


def test_a_frequency_above_the_limit_moves_nothing(positioner: Positioners) -> None:
    with pytest.raises(LimitError, match=r"positioner: 100.1 Hz is above its limit of 100 Hz; nothing was moved. Ask"):
        positioner(*told(*CYCLE)).oscillate("x", peak_to_peak_um=1.0, frequency_hz=100.1, centre_um=50.0)


@pytest.mark.parametrize("frequency_hz", [0.0, -1.0, 1000.1, math.inf, math.nan])
def test_a_frequency_that_no_wave_table_plays(positioner: Positioners, frequency_hz: float) -> None:
    with pytest.raises(LimitError, match=r"the wave tables cannot play .* at most 1000 Hz"):
        positioner(*told(*CYCLE)).oscillate("x", peak_to_peak_um=10.0, frequency_hz=frequency_hz, centre_um=50.0)


def test_a_record_has_a_header_and_rows(positioner: Positioners) -> None:
    answer = (
        "# TYPE = 1 \n# SEPARATOR = 32 \n# DIM = 1 \n# SAMPLE_TIME = 0.001 \n# NDATA = 3 \n"
        "# NAME0 = Actual Position of Axis1 \n# END_HEADER \n20.0001 \n20.1184 \n20.4734\n"
    )
    record = positioner(*told("DRL? 1\n", "1=3\n"), *told("DRR? 1 3 1\n", answer)).recorded("x")
    assert record.position_um.tolist() == [20.0001, 20.1184, 20.4734]
    assert record.interval_s == 0.001


def test_an_empty_record_is_an_error(positioner: Positioners) -> None:
    with pytest.raises(StreamError, match=r"positioner: the recorder has no values of x. Let the axis oscillate first"):
        positioner(*told("DRL? 1\n", "1=0\n")).recorded("x")


def test_a_record_that_is_too_short(positioner: Positioners) -> None:
    answer = "# SAMPLE_TIME = 0.001 \n# END_HEADER \n1.0 \n2.0\n"
    with pytest.raises(StreamError, match=r"positioner: the record of x has 2 rows instead of 3"):
        positioner(*told("DRL? 1\n", "1=3\n"), *told("DRR? 1 3 1\n", answer)).recorded("x")


def test_a_stop_in_the_middle_of_an_answer(positioner: Positioners) -> None:
    """What is left of a long record is not an answer to what follows."""
    rest = "20.4734 \n20.6183 \n20.7000\n"
    positioner(("\x18", rest), ("ERR?\n", "10\n"), ("\x09", "0\n"), ("\x05", "0\n")).stop()


def test_a_stop_is_one_byte_and_waits_until_nothing_moves(positioner: Positioners) -> None:
    positioner(
        ("\x18", ""),
        ("ERR?\n", "10\n"),  # stopped: no error of anyone
        ("\x09", "1\n"),
        ("\x09", "0\n"),
        ("\x05", "1\n"),
        ("\x09", "0\n"),
        ("\x05", "0\n"),
    ).stop()
