"""Every decoder and reader that takes bytes from outside."""

from __future__ import annotations

from tests.fuzz.files import FILES
from tests.fuzz.labs import LABS
from tests.fuzz.logs import LOGS
from tests.fuzz.target import Target
from tests.fuzz.texts import TEXTS
from tests.fuzz.twins import TWINS
from tests.fuzz.wires import WIRES

TARGETS: dict[str, Target] = WIRES | TWINS | LABS | FILES | LOGS | TEXTS
