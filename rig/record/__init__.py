"""The record: every run, pose and sample in one SQLite file that survives a kill at any moment."""

from rig.record.store import Record
from rig.record.values import Block, Event, KeptPose, Line, Run

__all__ = ["Block", "Event", "KeptPose", "Line", "Record", "Run"]
