"""What a server loads at its start is what the first analysis of a sweep needs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.browser.measured import hidden

PROGRAM = """import sys
from calibrations.means import kernels
from rig.services.request import Request
from rig.services.session import model_session
from rig.web.load_ahead import load_ahead

loops = [each for each in vars(kernels).values() if hasattr(each, "nopython_signatures")]
load_ahead()
ahead = [each.nopython_signatures for each in loops]
session = model_session(Request(sys.argv[1]))
session.compared()
print(any(ahead), ahead == [each.nopython_signatures for each in loops])
"""


def test_the_first_analysis_loads_no_machine_code(tmp_path: Path) -> None:
    words = [sys.executable, "-c", PROGRAM, hidden(tmp_path, "package turned")]
    ended = subprocess.run(words, capture_output=True, text=True, check=True)
    assert ended.stdout == "True True\n"
