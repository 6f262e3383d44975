"""A line on standard error when numerical functions are compiled: the first command of an installation waits for it.

The machine code is kept on disk, so later commands neither compile nor print the line.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from rig.cli.terminal.output import note

TEXT = "compiling the numerical functions, once after an installation or an update; this takes up to 40 s"
EVENTS = "numba.core.event"  # the module in which the compiler announces its work


def say_when_compiling() -> None:
    """Print the line at the first compilation of this process. The compiler is not loaded before a command needs it."""
    sys.meta_path.insert(0, _Watch())


class _Watch(MetaPathFinder):
    """Waits until the compiler has been imported, then listens to its events. Finds no module itself."""

    def __init__(self) -> None:
        self.listens = False

    def find_spec(
        self,
        fullname: str,  # noqa: ARG002 the import system calls it so
        path: Sequence[str] | None,  # noqa: ARG002
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        events = sys.modules.get(EVENTS)
        if not self.listens and hasattr(events, "register"):  # the import of the module is complete
            self.listens = True
            _listen(events)
        return None


def _listen(events: Any) -> None:
    """Print the line at the first event of a compilation."""

    class Announcement(events.Listener):  # type: ignore[misc] # the base class is known when the compiler is loaded
        said = False

        def on_start(self, _event: Any) -> None:
            if not self.said:
                self.said = True
                note(TEXT)

        def on_end(self, _event: Any) -> None:
            pass

    events.register("numba:compile", Announcement())
