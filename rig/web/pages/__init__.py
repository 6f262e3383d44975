"""The pages of the workbench: each registers itself for its address."""

from __future__ import annotations

from rig.web.desk import Desk
from rig.web.frame import static_files
from rig.web.pages import compare, fleet, history, import_file, model, not_found, record, run, run_record


def register(desk: Desk) -> None:
    """Register all pages."""
    static_files()
    for page in (model, run, record, run_record, compare, history, import_file, not_found, fleet):
        page.register(desk)
