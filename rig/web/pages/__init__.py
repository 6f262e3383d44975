"""The workbench's pages, one a file: each registers itself for its address."""

from __future__ import annotations

from rig.web.desk import Desk
from rig.web.frame import static_files
from rig.web.pages import model


def register(desk: Desk) -> None:
    """All pages, on one desk."""
    static_files()
    model.register(desk)
