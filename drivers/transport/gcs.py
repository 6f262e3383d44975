"""PI General Command Set 2.0, the controller's side: lines of text, each followed by `ERR?`.

Commands and answers end with LF; the lines of a longer answer end with space and LF, only the last with LF alone.
Commands for an urgent matter are one byte without LF. A refused command has no answer: only `ERR?` gives the reason.
There is no checksum, and nothing is sent twice.
Source: PI GCS 2.0 as PI's own client uses it.
"""

from __future__ import annotations

from collections.abc import Callable

from drivers.errors import BadFrame, LinkTimeout, Refused
from drivers.transport.link import Link

TIMEOUT_S = 1.0  # without a byte; the longest answers arrive in many pieces
LONGEST_S = 300.0  # of one answer: a full recorder over a serial line
QUIET_S = 0.02  # without bytes: the end of an interrupted answer
LATIN = "latin-1"  # one character is one byte
REMEDY = "Check power and cable, and that no other program uses the controller"


class Gcs:
    """One controller on its link. `explain` gives (meaning, remedy) for an error number."""

    def __init__(self, link: Link, name: str, explain: Callable[[int], tuple[str, str]]) -> None:
        self.name, self.link = name, link
        self._explain = explain
        self._late_expected = False  # whether the answer to an earlier question may still arrive

    def tell(self, command: str) -> None:
        """Send a command that has no answer. Raises Refused with the controller's error."""
        self._send(command + "\n")
        self._require_no_error(command)

    def ask(self, question: str) -> list[str]:
        """The lines of the answer, without their ends. Raises Refused with the controller's error."""
        self._send(question + "\n")
        try:
            lines = self._lines(question)
        except LinkTimeout:
            self._require_no_error(question)
            raise
        self._require_no_error(question)
        return lines

    def ask_byte(self, number: int) -> str:
        """The answer to a command of one byte; it does not change the error number."""
        self._send(chr(number))
        return self._lines(f"#{number}")[0]

    def tell_byte(self, number: int) -> None:
        """Send a command of one byte without an answer, at once; the answer that it interrupts is discarded."""
        self.link.write(bytes([number]))
        self.link.discard(QUIET_S)

    def error(self) -> int:
        """The controller's error number, 0 for none. The controller resets it with this answer."""
        self._send("ERR?\n")
        answer = self._lines("ERR?")[0]
        try:
            return int(answer)
        except ValueError:
            raise self._unexpected("ERR?", answer) from None

    def values(self, question: str) -> dict[str, float]:
        """An answer of lines `key=value`, by key."""
        return {key: self._number(question, text) for key, text in self._pairs(question)}

    def number(self, question: str) -> float:
        """An answer of one line, which is a number or `keys=number`."""
        return self._number(question, self.ask(question)[0].rpartition("=")[2])

    def rows(self, question: str) -> tuple[dict[str, str], list[list[float]]]:
        """An answer with a header of lines `# KEY = value`: that header, and rows of numbers."""
        lines = self.ask(question)
        header = [line[1:].partition("=") for line in lines if line.startswith("#")]
        rows = [[self._number(question, text) for text in line.split()] for line in lines if not line.startswith("#")]
        return {key.strip(): text.strip() for key, _, text in header}, rows

    def _pairs(self, question: str) -> list[tuple[str, str]]:
        parted = [(line, line.partition("=")) for line in self.ask(question)]
        if bad_lines := [line for line, (_, equals, _) in parted if not equals]:
            raise self._unexpected(question, bad_lines[0])
        return [(key.strip(), text) for _, (key, _, text) in parted]

    def _number(self, question: str, text: str) -> float:
        try:
            return float(text)
        except ValueError:
            raise self._unexpected(question, text) from None

    def _send(self, text: str) -> None:
        """Send `text`; discard earlier bytes: they are not the answer to it."""
        self.link.discard(TIMEOUT_S if self._late_expected else 0.0)
        self._late_expected = False
        self.link.write(text.encode(LATIN))

    def _lines(self, question: str) -> list[str]:
        data, deadline = b"", self.link.clock.now() + LONGEST_S
        while not data.endswith(b"\n") or data.endswith(b" \n"):
            next_bytes = self.link.read(TIMEOUT_S)
            if not next_bytes or self.link.clock.now() > deadline:
                self._late_expected = True
                raise self._silent(question, data)
            data += next_bytes
        return [line.rstrip() for line in data.decode(LATIN).splitlines()]

    def _silent(self, question: str, data: bytes) -> LinkTimeout | BadFrame:
        if data:
            return BadFrame(f"{self.name}: the answer to {question} breaks off after {len(data)} bytes", REMEDY)
        return LinkTimeout(f"{self.name}: no answer to {question} within {TIMEOUT_S:g} s on {self.link.url}", REMEDY)

    def _unexpected(self, question: str, answer: str) -> BadFrame:
        return BadFrame(f"{self.name}: {answer[:40]!r} is not an answer to {question}", REMEDY)

    def _require_no_error(self, command: str) -> None:
        if code := self.error():
            meaning, remedy = self._explain(code)
            raise Refused(f"{self.name}: {command}: error {code}, {meaning}", remedy, code)
