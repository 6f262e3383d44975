"""The person of a simulated bench: does in the simulated world what a question asks for, and answers.

On a bench with a real instrument there is no such person, and `answer` has nothing to say.
"""

from __future__ import annotations

from procedures.questions import Choice, Confirm, Mounting, Number, Question
from rig.instruments import Rig


def answer(question: Question, rig: Rig) -> str | None:
    """What a technician at the simulated bench answers; None on a real one, or where even they cannot know."""
    if rig.world is None or not rig.bench.simulated:
        return None
    if isinstance(question, Mounting):
        rig.world.mount_sensor(question.mount_deg, question.flip)
    if isinstance(question, Confirm):
        return "yes"
    if isinstance(question, Choice):
        return question.choices[0]
    if isinstance(question, Number) and question.name.startswith("level-"):
        x_deg, y_deg = rig.world.level_deg()
        return f"{x_deg if question.name.endswith('-x') else y_deg:.2f}"
    return None
