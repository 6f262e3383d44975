"""Where this application keeps its data: `RIG_HOME`, else the user's data folder."""

from __future__ import annotations

import os
from pathlib import Path


def home() -> Path:
    """The folder of the record; it is made when something is first written there."""
    if named := os.environ.get("RIG_HOME"):
        return Path(named).expanduser()
    import platformdirs

    return Path(platformdirs.user_data_dir("inertial-rig"))
