"""Which drawing belongs to a question: by its mounting, or by the name that it gives."""

from __future__ import annotations

from procedures.questions import Mounting, Question
from rig.drawings.attitude import Attitude

NAMED = {"face-up": Attitude(), "face-down": Attitude(flip=1), "on-positioner": Attitude(shaken=True)}


def drawing_of(question: Question) -> Attitude | None:
    """How the sensor is to be mounted; None for a question without a drawing, or with one that is not known here.

    A sensor on edge has none: its words say where two of its axes point.
    """
    if isinstance(question, Mounting) and question.up == "z":
        return Attitude(mount_deg=question.mount_deg, flip=question.flip)
    return NAMED.get(question.drawing)
