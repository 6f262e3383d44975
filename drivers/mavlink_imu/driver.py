"""A flight controller (PX4, ArduPilot) that sends its samples by MAVLink, over UDP, TCP or a serial line.

It is in the role of the converter. The driver waits for the heartbeat of the autopilot, requests the message of the
settings at `rate_hz`, and waits for the acknowledgement. Every message has a number, so lost and repeated messages are
known; the sensor's time in the message tells which of them were samples. A record with more than `most_lost` of its
samples lost is refused, as is one with an axis at the end of its range, stuck, or not sent at all.

Source  MAVLink, message definitions `common`: HIGHRES_IMU, SCALED_IMU, RAW_IMU, MAV_CMD_SET_MESSAGE_INTERVAL.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from drivers.digital.frames import FrameDecoder, Frames, Ints, groups
from drivers.digital.reception import Batch, Floats, Numbers, Reception, TimeBase
from drivers.digital.sensor import DigitalSensor
from drivers.digital.settings import OUTPUTS, MessageSettings
from drivers.errors import DriverError, LinkTimeout, Refused, SensorFault
from drivers.instrument import Identity
from drivers.mavlink_imu import messages as mav
from drivers.transport import Address, Links
from drivers.transport.link import Link

HEARTBEAT_S = 3.0  # it comes once a second
ACK_S, ATTEMPTS = 1.0, 3
GROUND = (255, 190)  # our own system and component: those of a ground station
END = 32767  # of a count of 16 bits, each way
NO_TEMPERATURE = 0  # in messages of whole numbers
WARM = 1 << 12  # bit of `fields_updated` for the temperature
UPDATE_BITS = {name: 1 << k for k, name in enumerate(OUTPUTS)}  # bits of `fields_updated`


@dataclass(frozen=True)
class Settings(MessageSettings):
    """The message and its outputs: accelerometer (ax, ay, az), gyroscope (gx, gy, gz) and magnetometer (mx, my, mz).

    HIGHRES_IMU is in m/s^2, rad/s and gauss, SCALED_IMU in g, rad/s and gauss. The numbers of RAW_IMU are counts by the
    definition, and milli-g, mrad/s and mgauss from ArduPilot: `raw` must be `count` or `milli`. `imu` is the number
    (`id`) of the sensor in HIGHRES_IMU and RAW_IMU. `range` is the end of the accelerometer's range each way, in its
    unit. Raises ValueError for impossible values.
    """

    message: Literal["HIGHRES_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3", "RAW_IMU"] = "HIGHRES_IMU"
    raw: Literal["count", "milli"] | None = None
    imu: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.message == "RAW_IMU") != (self.raw is not None):
            raise ValueError("raw must be `count` or `milli` with RAW_IMU, and is not for another message")
        if not 0 <= self.imu <= 255 or (self.imu and self.message.startswith("SCALED")):
            raise ValueError("imu must be 0 to 255; SCALED_IMU2 and SCALED_IMU3 are separate messages")

    @property
    def kinds(self) -> tuple[str, str, str]:
        if self.message == "HIGHRES_IMU":
            return "m/s^2", "rad/s", "gauss"
        return ("count", "count", "count") if self.raw == "count" else ("g", "rad/s", "gauss")

    @property
    def factor(self) -> float:
        """Factor from a number in the message to the unit of the output."""
        return 1.0 if self.message == "HIGHRES_IMU" or self.raw == "count" else 1e-3

    @property
    def time_unit_s(self) -> float:
        return 1e-3 if self.message.startswith("SCALED") else 1e-6


class SampleDecoder(FrameDecoder):
    """Samples of the outputs `names` out of the messages of one autopilot."""

    def __init__(self, settings: Settings, target: tuple[int, int]) -> None:
        super().__init__(mav.Mavlink())
        self.seen: Counter[str] = Counter()
        self.updated = 0
        self._settings, self._target = settings, target
        self._names = tuple(settings.channels)
        self._columns = [OUTPUTS.index(name) for name in self._names]
        self._message = mav.IMU[settings.message]
        self._numbers = Numbers(256)

    def take(self, data: bytes) -> Batch:
        messages = self.stream.take(data)
        heads = mav.heads(messages)
        for number, group in groups(heads.number):
            self.seen[mav.MESSAGES[number].name if number in mav.MESSAGES else f"{number}"] += len(heads.number[group])
        own_frames = np.flatnonzero((heads.system == self._target[0]) & (heads.component == self._target[1]))
        samples = own_frames[messages.known[own_frames] & (heads.number[own_frames] == self._message.number)]
        gaps = self._numbers.gaps(heads.sequence[own_frames], np.searchsorted(own_frames, samples))
        content = mav.contents(messages, heads, self._message, samples)
        if "id" in (self._message.dtype.names or ()) and len(samples):
            of_imu = content["id"] == self._settings.imu
            content, gaps = content[of_imu], gaps[of_imu]
        return self._batch(content, gaps)

    def _batch(self, content: NDArray[np.void], gaps: Ints) -> Batch:
        numbers = np.concatenate([content[sensor] for sensor in "agm"], axis=1).astype(np.float64)
        values = numbers[:, self._columns] * self._settings.factor
        clipped = ""
        if len(content) and self._message is not mav.HIGHRES_IMU:
            ends = (np.abs(numbers[:, self._columns]) >= END).any(axis=0)
            clipped = self._names[int(np.argmax(ends))] if ends.any() else ""
        elif len(content):
            self.updated |= int(np.bitwise_or.reduce(content["updated"]))
        return Batch(values, content["time"].astype(np.float64), gaps, clipped, self._warm_c(content))

    def _warm_c(self, content: NDArray[np.void]) -> Floats:
        """The temperatures in the messages that have one."""
        raw = content["temperature"].astype(np.float64)
        if self._message is mav.HIGHRES_IMU:
            return np.asarray(raw[content["updated"] & WARM != 0])
        return np.asarray(raw[raw != NO_TEMPERATURE] / 100)


class FlightController(DigitalSensor[Settings, SampleDecoder]):
    """The autopilot at the other end of the link."""

    carrier = "messages"
    protocol, usual_line = "MAVLink", "serial:/dev/ttyACM0?baud=57600"
    longest = 4 * mav.LONGEST

    def __init__(self, link: Link, settings: Settings, name: str) -> None:
        super().__init__(link, settings, name)
        self._autopilot: tuple[int, int, str, int] | None = None  # system, component, name, version of the protocol
        self._sequence = 0

    def identify(self) -> Identity:
        """The autopilot by its heartbeat. Raises LinkTimeout without one, BadFrame for other bytes."""
        system, component, name, version = self._read_heartbeat()
        protocol = "MAVLink 1" if version == mav.V1 else "MAVLink 2"
        return Identity(f"{name}, {protocol}, system {system}, component {component}")

    @property
    def base(self) -> TimeBase:
        return TimeBase(self.settings.time_unit_s, (2**32,) if self.settings.message.startswith("SCALED") else ())

    def _decoder(self) -> SampleDecoder:
        return SampleDecoder(self.settings, self._autopilot[:2] if self._autopilot else (0, 0))

    def _begin(self) -> None:
        """Request the message at its rate. Raises Refused, LinkTimeout."""
        if self._autopilot is None:
            self._read_heartbeat()
        number, interval_us = mav.IMU[self.settings.message].number, 1e6 / self.settings.rate_hz
        for attempt in range(ATTEMPTS):
            self._link.discard()
            self._command(mav.SET_MESSAGE_INTERVAL, number, interval_us, attempt)
            result = self._await_result(mav.SET_MESSAGE_INTERVAL)
            if result == 0:
                self._link.discard()
                return
            if result is not None:
                raise Refused(
                    f"{self.name}: the autopilot refuses {self.settings.message} at {self.settings.rate_hz:g} Hz: "
                    f"{mav.RESULTS.get(result, f'result {result}')}",
                    "Choose a message and a rate that its firmware can send, in the sensor's settings",
                    result,
                )
        raise LinkTimeout(
            f"{self.name}: no acknowledgement of the request of {self.settings.message} within "
            f"{ATTEMPTS * ACK_S:g} s on {self._link.url}",
            "Check that the link carries commands to the autopilot, and not only its messages",
        )

    def _read_heartbeat(self) -> tuple[int, int, str, int]:
        """System, component, name and protocol of the autopilot, by its heartbeat.

        Our own heartbeat goes first: many autopilots send only to who has sent to them.
        """
        self._link.discard()
        self._send(mav.HEARTBEAT, type=mav.GROUND_STATION, autopilot=mav.INVALID, status=4, version=3)
        stream, count = Frames(mav.Mavlink()), 0
        for data in self._link.until(self._clock.now() + HEARTBEAT_S):
            messages = stream.take(data)
            heads = mav.heads(messages)
            beats = np.flatnonzero((heads.number == mav.HEARTBEAT.number) & messages.known)
            for k, beat in zip(beats, mav.contents(messages, heads, mav.HEARTBEAT, beats), strict=True):
                if beat["autopilot"] != mav.INVALID and beat["type"] not in mav.OTHER_TYPES:
                    name = mav.AUTOPILOTS.get(int(beat["autopilot"]), f"autopilot {beat['autopilot']}")
                    self._autopilot = int(heads.system[k]), int(heads.component[k]), name, int(heads.version[k])
                    return self._autopilot
            count += len(messages.starts)
        if stream.unread and not stream.good:
            raise self._no_frames(stream)
        raise LinkTimeout(
            f"{self.name}: no heartbeat of an autopilot on {self._link.url} within {HEARTBEAT_S:g} s "
            f"({count} other messages)",
            "Check power and cable, that MAVLink is on at this port of the autopilot, and the address",
        )

    def _command(self, command: int, *parameters: float) -> None:
        """Send a command; the last of `parameters` is the number of the attempt."""
        assert self._autopilot  # noqa: S101 - a request follows the heartbeat
        system, component = self._autopilot[:2]
        *numbers, attempt = parameters
        seven = [*numbers, *[0.0] * (7 - len(numbers))]
        self._send(
            mav.COMMAND_LONG,
            parameters=seven,
            command=command,
            system=system,
            component=component,
            confirmation=attempt,
        )

    def _send(self, message: mav.Message, **values: Any) -> None:
        version = self._autopilot[3] if self._autopilot else mav.V2
        (frame,) = mav.frames(message, mav.fields(message, **values), np.array([self._sequence]), *GROUND, version)
        self._sequence += 1
        self._link.write(frame)

    def _await_result(self, command: int) -> int | None:
        """The result of a command; None without an answer in time."""
        stream = Frames(mav.Mavlink())
        for data in self._link.until(self._clock.now() + ACK_S):
            messages = stream.take(data)
            heads = mav.heads(messages)
            answers = np.flatnonzero((heads.number == mav.COMMAND_ACK.number) & messages.known)
            for answer in mav.contents(messages, heads, mav.COMMAND_ACK, answers):
                if answer["command"] == command and mav.RESULTS.get(int(answer["result"])) != "in progress":
                    return int(answer["result"])
        return None

    def _require_complete(self, reception: Reception, decoder: SampleDecoder) -> None:
        super()._require_complete(reception, decoder)
        if self.settings.message == "HIGHRES_IMU" and (
            missing := [name for name in self.settings.channels if not decoder.updated & UPDATE_BITS[name]]
        ):
            raise SensorFault(
                f"{self.name}: the autopilot sends no {', '.join(missing)} (fields_updated is {decoder.updated:#x})",
                "Remove these outputs from the sensor's settings, or choose another message or `imu`",
            )

    def _content(self, decoder: SampleDecoder) -> str:
        counts_text = ", ".join(f"{name} {count}" for name, count in sorted(decoder.seen.items()))
        return counts_text + self._warm

    @property
    def _expected(self) -> str:
        return self.settings.message

    def _unreadable(self, decoder: SampleDecoder) -> DriverError:
        if decoder.unread <= self.longest and decoder.good:
            return self._silence(2.0)
        return self._no_frames(decoder.stream)


def connect(address: Address, links: Links, settings: Settings, name: str) -> FlightController:
    """The autopilot at `address`. Raises LinkRefused when its link cannot be opened."""
    return FlightController(links.link(address.url, name), settings, name)
