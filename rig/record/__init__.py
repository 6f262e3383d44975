"""The record: every run, pose and sample in one SQLite file that survives a kill at any moment."""

from rig.record.store import Record
from rig.record.values import Event, KeptPose, LogLine, Run

__all__ = ["Event", "KeptPose", "LogLine", "Record", "Run"]
