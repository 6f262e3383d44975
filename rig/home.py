"""Where this application keeps its data: `RIG_HOME`, else the user's data folder; and which record is read."""

from __future__ import annotations

import os
from pathlib import Path

RECORD = "RIG_RECORD"  # the lab's record, by its URL, where that is read instead of the rig's own
LAB = "RIG_LAB"  # where `rig push` brings runs


def home() -> Path:
    """The folder of the record; it is made when something is first written there."""
    if named := os.environ.get("RIG_HOME"):
        return Path(named).expanduser()
    import platformdirs

    return Path(platformdirs.user_data_dir("inertial-rig"))
