"""A rotary stage that is turned by hand to an angle on its dial: the stages of Ang V, resolution 5 arcmin.

A person sets the requested angle, and confirms it or types the reading of the dial. The reading is the angle of the
stage. A dial is absolute, so there is no homing. Without a request nobody turns the stage, so there is nothing to stop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NoReturn

from drivers.errors import LimitError, LinkRefused, NotSettled
from drivers.instrument import OUTSIDE_ANGLE, Check, Identity, require_positive, require_range, require_within
from drivers.transport import Address, Links
from drivers.transport.person import PERSON, PersonLink

UNIT = "deg"


@dataclass(frozen=True)
class Settings:
    """Settings of one stage: its dial, the tolerance of a reading, its limits, and the time of a move by hand.

    Raises ValueError for impossible values.
    """

    resolution_deg: float = 5 / 60  # of the dial
    tolerance_deg: float = 0.5
    limits_deg: tuple[float, float] = (-400.0, 400.0)
    seconds_per_move: float = 20.0

    def __post_init__(self) -> None:
        require_positive(self, "resolution_deg", "tolerance_deg", "seconds_per_move")
        if self.tolerance_deg < self.resolution_deg:
            raise ValueError("tolerance_deg must not be less than resolution_deg")
        require_range(self, "limits_deg")

    def move_s(self, distance_deg: float) -> float:  # noqa: ARG002 a hand is as quick on any way
        """Duration of a move, s."""
        return self.seconds_per_move

    def rate_deg_s(self, asked_deg_s: float) -> float:
        """The rate as requested: `way_of_turn` refuses it."""
        return asked_deg_s

    def way_of_turn(self, name: str, rate_deg_s: float, first_deg: float, last_deg: float) -> NoReturn:
        """Raises LimitError: no hand turns at a constant rate."""
        raise LimitError(
            f"{name}: a person turns this stage; it cannot turn from {first_deg:g} to {last_deg:g} deg "
            f"at {rate_deg_s:g} deg/s",
            "Use a stage with a motor for this procedure",
        )


class ManualStage:
    """A stage whose angle a person sets and reads."""

    def __init__(self, person: PersonLink, settings: Settings, name: str) -> None:
        self.name = name
        self.settings = settings
        self._person = person
        self._set_deg = math.nan
        self.read_deg: float | None = None  # the last reading of the dial

    def identify(self) -> Identity:
        """A general name, without a question to the person: a dial has no name."""
        return Identity("stage turned by hand")

    def self_test(self) -> list[Check]:
        """The resolution of the dial, without a question to the person."""
        return [Check("dial", True, f"read by a person to {60 * self.settings.resolution_deg:g} arcmin")]

    def angle_deg(self) -> float:
        """The last reading of the dial. Asks the person if there is none yet."""
        if self.read_deg is None:
            low, high = self.settings.limits_deg
            text = f"What does the dial of {self.name} show?"
            self.read_deg = self._person.ask(f"{self.name}-dial", text, UNIT, low, high)
        return self.read_deg

    def referenced(self) -> bool:
        """Always true: a dial is absolute."""
        return True

    def home(self) -> None:
        """Do nothing: a manual stage has no home position."""

    def move_to(self, angle_deg: float) -> None:
        """Ask a person to turn the stage to `angle_deg`. Asks nothing if the stage is at this angle already.

        Raises LimitError before anybody is asked, NotSettled for a reading elsewhere, and what comes from the person.
        """
        require_within(
            f"{self.name}: ", angle_deg, self.settings.limits_deg, "deg", OUTSIDE_ANGLE, "no request was made"
        )
        if angle_deg == self._set_deg:
            return
        self._set_deg, self.read_deg = math.nan, None  # the angle of an interrupted move is not known
        reach = self.settings.tolerance_deg
        text = f"Turn {self.name} to {angle_deg:g} deg. What does its dial show?"
        name = f"{self.name}-{angle_deg:g}"
        read_deg = self._person.ask(name, text, UNIT, angle_deg - reach, angle_deg + reach, angle_deg)
        if not abs(read_deg - angle_deg) <= reach:
            raise NotSettled(
                f"{self.name}: the dial shows {read_deg:g} deg, but {angle_deg:g} deg was requested",
                f"Set it to within {reach:g} deg, and read it again",
            )
        self._set_deg, self.read_deg = angle_deg, read_deg

    def rate_deg_s(self, asked_deg_s: float) -> float:
        """The rate as requested: `turning` refuses it."""
        return asked_deg_s

    def turning(self, rate_deg_s: float, first_deg: float, last_deg: float) -> NoReturn:
        """Raises LimitError: no hand turns at a constant rate."""
        self.settings.way_of_turn(self.name, rate_deg_s, first_deg, last_deg)

    def stop(self) -> None:
        """Do nothing: the stage turns only while a person turns it."""


def connect(address: Address, links: Links, settings: Settings, name: str) -> ManualStage:
    """The stage that the person at the rig turns, without a question. Raises LinkRefused for any other address."""
    if address.url != PERSON:
        raise LinkRefused(
            f"{name}: {address.url!r} is not the address of a person", f"Write `url: {PERSON}` in the bench file"
        )
    return ManualStage(links.person, settings, name)
