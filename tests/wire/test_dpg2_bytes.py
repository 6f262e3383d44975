"""The DPG2 driver's bytes, written out from the manual's tables; and lines as a serial cable may deliver them."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from drivers.clock import SimulatedClock
from drivers.dpg2 import driver as dpg2
from drivers.dpg2.driver import Level, Settings
from drivers.errors import BadFrame, InstrumentError, LinkTimeout, NotSettled
from drivers.transport import Address, Links
from drivers.transport.server import Connection, Port, Server, Twin

Answers = dict[bytes, list[bytes]]
Levels = Callable[..., Level]
SINGLE = Settings(readings=1)


class Talker(Twin):
    """Answers each letter with the next of its answers, the last one for ever; says `babble` every 0.1 s."""

    def __init__(self, answers: Answers, babble: bytes) -> None:
        self.port = Port("rtu+tcp://127.0.0.1:0?baud=9600", self._answer)
        self.server = Server([self.port], {"level": self}, {})
        self._answers, self._babble, self._said = {key: list(lines) for key, lines in answers.items()}, babble, 0
        self.asked = b""

    def advance(self, now_s: float) -> None:
        while self._babble and self.due_s() <= now_s:
            self._said += 1
            for connection in self.port.connections.values():
                connection.send(self._babble, now_s)

    def due_s(self) -> float:
        return 0.1 * (self._said + 1) if self._babble else float("inf")

    def _answer(self, connection: Connection, now_s: float) -> None:
        letter, connection.inbox[:] = bytes(connection.inbox), b""
        self.asked += letter
        answers = self._answers.get(letter, [b""])
        connection.send(answers.pop(0) if len(answers) > 1 else answers[0], now_s + 0.025)


@pytest.fixture
def level(clock: SimulatedClock, links: Links) -> Iterator[Levels]:
    talkers: list[Talker] = []

    def connect(answers: Answers, settings: Settings = SINGLE, babble: bytes = b"") -> Level:
        talkers.append(Talker({b"s": [b"s"]} | answers, babble))
        clock.attach(talkers[-1].server)
        found = dpg2.connect(Address(talkers[-1].port.url), links, settings, "level")
        found.talker = talkers[-1]  # type: ignore[attr-defined]
        return found

    yield connect
    for talker in talkers:
        talker.server.close()


def shown(level: Level) -> tuple[float, float]:
    reading = level.read()
    return reading.x_deg, reading.y_deg


def test_it_is_stopped_and_asked_for_one_reading(level: Levels) -> None:
    found = level({b"R": [b"X=+01.234\r\nY=-00.007\r\n"]})
    assert shown(found) == (1.234, -0.007)
    assert found.talker.asked == b"ssR"  # type: ignore[attr-defined]


def test_two_digits_as_the_30_deg_model_has_them(level: Levels) -> None:
    assert shown(level({b"R": [b"X=+00.43\r\nY=-00.08\r\n"]})) == (0.43, -0.08)


def test_version_and_serial_number(level: Levels) -> None:
    identity = level({b"V": [b"DPL2 V1.8.0\r\nSN:123456789\r\n"]}).identify()
    assert (identity.model, identity.serial, identity.firmware) == ("MEAS DPG2", "123456789", "DPL2 V1.8.0")


@pytest.mark.parametrize(
    "answer",
    [
        b"0.007\r\nX=+01.234\r\nY=-00.007\r\n",
        b"Y=+09.999\r\nX=+01.234\r\nY=-00.007\r\n",
        b"X=+09.9sX=+09.999\r\nY=+0s9.999\r\nX=+01.234\r\nY=-00.007\r\n",
        b"s\xff\x00\xfeX=+01.234\r\nY=-00.007\r\nX=+09.9",
    ],
    ids=["joined in the middle", "joined at Y", "echo inside", "garbage around"],
)
def test_the_first_whole_pair_of_lines_counts(level: Levels, answer: bytes) -> None:
    assert shown(level({b"R": [answer]})) == (1.234, -0.007)


def test_a_spoilt_answer_is_asked_for_again(level: Levels) -> None:
    assert shown(level({b"R": [b"", b"X=+01.2\x7f4\r\nY=-00.007\r\n", b"X=+01.234\r\nY=-00.007\r\n"]})) == (
        1.234,
        -0.007,
    )


def test_a_level_that_does_not_hear_the_stop_is_read_as_it_talks(level: Levels) -> None:
    found = level({b"s": [b""]}, Settings(readings=1), babble=b"X=+01.234\r\nY=-00.007\r\n")
    assert shown(found) == (1.234, -0.007)


def test_silence_is_told_with_its_cause(level: Levels, clock: SimulatedClock) -> None:
    found = level({b"s": [b""]})
    began_s = clock.now()
    with pytest.raises(LinkTimeout, match=r"level: asking for its reading \(R\) .* no answer .*9600 baud"):
        found.read()
    assert clock.now() - began_s < 3.0
    with pytest.raises(LinkTimeout, match=r"level: asking for its version \(V\)"):
        found.identify()


@pytest.mark.parametrize("babble", [b"\x00", b"X=+01.234\r\n", b"X=1.2 Y=0.3\r\n"])
def test_garbage_without_end_is_told_in_bounded_time(level: Levels, clock: SimulatedClock, babble: bytes) -> None:
    found = level({}, babble=babble)
    began_s = clock.now()
    with pytest.raises(BadFrame, match=r"level: asking for its reading .* received .* bytes that are not a reading"):
        found.read()
    assert clock.now() - began_s < 4.0


@pytest.mark.parametrize("answer", [b"X=+++++++\r\nY=-00.007\r\n", b"X=+00.007\r\nY=-------\r\n"])
def test_beyond_its_range_it_shows_no_angle(level: Levels, answer: bytes) -> None:
    found = level({b"R": [answer]})
    with pytest.raises(InstrumentError, match=r"level: the [xy] axis is beyond its range of 30 deg .* Turn alpha to 0"):
        found.read()
    (check,) = found.self_test()
    assert not check.ok
    assert "beyond its range" in check.detail


PAIRS = [b"X=+01.000\r\nY=-00.000\r\n", b"X=+01.002\r\nY=+00.002\r\n"]


def test_a_mean_with_its_standard_deviation(level: Levels) -> None:
    reading = level({b"R": PAIRS}, Settings(readings=2)).read()
    assert (reading.x_deg, reading.y_deg) == pytest.approx((1.001, 0.001))
    assert (reading.std_deg, reading.n, reading.accuracy_deg) == (pytest.approx(0.001), 2, 0.1)  # sqrt(2)/sqrt(2) mdeg


def test_a_single_reading_is_as_sure_as_its_last_digit(level: Levels) -> None:
    assert level({b"R": PAIRS[:1]}).read().std_deg == pytest.approx(0.001 / 12**0.5)


def test_it_waits_until_the_level_is_at_rest(level: Levels) -> None:
    swinging = [b"X=+0%d.000\r\nY=+00.000\r\n" % k for k in range(5)]
    assert shown(level({b"R": swinging + PAIRS}, Settings(readings=2))) == pytest.approx((1.001, 0.001))


def test_a_level_whose_readings_scatter_is_an_error(level: Levels, clock: SimulatedClock) -> None:
    swinging = [b"X=+0%d.000\r\nY=+00.000\r\n" % (k % 2) for k in range(300)]
    found = level({b"R": swinging}, Settings(readings=5))
    began_s = clock.now()
    with pytest.raises(NotSettled, match=r"level: after 10 s readings still scatter by 0.387 deg. Wait until"):
        found.read()
    assert clock.now() - began_s < 11.0


def test_a_repeated_reading_of_the_level_is_an_error(level: Levels) -> None:
    with pytest.raises(
        InstrumentError, match=r"x \+1.000, y -0.000 deg was received 30 times in a row. Switch the level off"
    ):
        level({b"R": PAIRS[:1]}, Settings(readings=10)).read()
    stuck_after_a_swing = level({b"R": [PAIRS[1], PAIRS[0]]}, Settings(readings=10))
    assert stuck_after_a_swing.read().n == 10  # one of them differs
    with pytest.raises(InstrumentError, match="times in a row"):
        stuck_after_a_swing.read()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"readings": 0}, "readings must be at least 1"),
        ({"readings": 30}, "frozen more than readings"),
        ({"interval_s": 0.0, "range_deg": float("nan")}, "interval_s, range_deg must be positive"),
    ],
)
def test_impossible_settings_are_refused(settings: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Settings(**settings)
