"""The person of a simulated bench: does in the simulated world what a question asks for, and answers.

On a bench with a real instrument there is no such person, and `answer` has nothing to say.
"""

from __future__ import annotations

from functools import singledispatch

from drivers.manual_stage_twin import Hand
from drivers.simulation.batch import Batch
from drivers.simulation.world import World
from procedures.questions import Choice, Confirm, Dial, Mounting, Number, PowerCycle, Question, Remount
from rig.connected.instruments import Rig


def answer(question: Question, rig: Rig) -> str | None:
    """What a technician at the simulated bench answers; None on a real one, or where even they cannot know."""
    if rig.world is None or not rig.bench.simulated:
        return None
    rig.world.advance(max(rig.clock.now(), rig.world.now_s))
    return _done(question, rig, rig.world)


@singledispatch
def _done(question: Question, rig: Rig, world: World | Batch) -> str | None:  # noqa: ARG001
    """The answer, after what was asked for was done; each kind of question has its own."""
    return None


@_done.register
def _(question: Confirm, rig: Rig, world: World | Batch) -> str:  # noqa: ARG001
    return "yes"


@_done.register
def _(question: Choice, rig: Rig, world: World | Batch) -> str:  # noqa: ARG001
    return question.choices[0]


@_done.register
def _(question: Mounting, rig: Rig, world: World | Batch) -> str:  # noqa: ARG001
    world.mount_sensor(question.mount_deg, question.flip, question.up)
    return "yes"


@_done.register
def _(question: Remount, rig: Rig, world: World | Batch) -> str:  # noqa: ARG001
    world.mount_sensor()
    return "yes"


@_done.register
def _(question: PowerCycle, rig: Rig, world: World | Batch) -> str:
    world.power(False)
    rig.clock.sleep(question.off_s)
    world.advance(rig.clock.now())
    world.power(True)
    return "yes"


@_done.register
def _(question: Number, rig: Rig, world: World | Batch) -> str | None:  # noqa: ARG001
    if not question.name.startswith("level-"):
        return None
    x_deg, y_deg = world.level_deg()
    return f"{x_deg if question.name.endswith('-x') else y_deg:.2f}"


@_done.register
def _(question: Dial, rig: Rig, world: World | Batch) -> str:
    """Turn the stage where it does not stand yet, which takes its time; read the dial."""
    settings = rig.bench.instruments[question.stage].typed_settings()
    hand = Hand(world, question.stage, settings, rig.bench.seed)
    turn = None if question.expected is None else hand.turn_to(question.expected)
    if turn is not None:
        rig.clock.sleep(max(settings.seconds_per_move, turn.end_s - world.now_s))
        world.advance(rig.clock.now())
    return f"{hand.read_deg():.4f}"
