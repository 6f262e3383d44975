"""The simulated technician: does the work of a question in the simulated world, and answers.

On a bench with a real instrument `answer` returns None.
"""

from __future__ import annotations

from functools import singledispatch

from drivers.handheld.world import HandheldWorld
from drivers.manual_stage.twin import Hand
from drivers.world.batch import AnyWorld
from procedures.questions import Choice, Confirm, Dial, Mounting, Number, PowerCycle, Question, Remount
from procedures.session import Guidance
from rig.instruments.instruments import Rig


def answer(question: Question, rig: Rig) -> str | None:
    """The answer of the simulated technician; None on a real bench, and for a question without a known answer."""
    if rig.world is None or not rig.bench.simulated:
        return None
    rig.world.advance(max(rig.clock.now(), rig.world.now_s))
    return _do_work(question, rig, rig.world)


def follow(guidance: Guidance, rig: Rig) -> None:
    """Start the simulated hand with this instruction. A bench with a real instrument has none."""
    if isinstance(rig.world, HandheldWorld) and rig.bench.simulated and guidance.moves:
        rig.world.advance(max(rig.clock.now(), rig.world.now_s))
        rig.world.turn_by_hand(guidance.up, guidance.north)


@singledispatch
def _do_work(question: Question, rig: Rig, world: AnyWorld) -> str | None:  # noqa: ARG001
    """Do the work, and answer. Each kind of question has its own function."""
    return None


@_do_work.register
def _(question: Confirm, rig: Rig, world: AnyWorld) -> str:  # noqa: ARG001
    return "yes"


@_do_work.register
def _(question: Choice, rig: Rig, world: AnyWorld) -> str:  # noqa: ARG001
    return question.choices[0]


@_do_work.register
def _(question: Mounting, rig: Rig, world: AnyWorld) -> str:  # noqa: ARG001
    world.mount_sensor(question.mount_deg, question.flip, question.up)
    return "yes"


@_do_work.register
def _(question: Remount, rig: Rig, world: AnyWorld) -> str:  # noqa: ARG001
    world.mount_sensor()
    return "yes"


@_do_work.register
def _(question: PowerCycle, rig: Rig, world: AnyWorld) -> str:
    world.power(False)
    rig.clock.sleep(question.off_s)
    world.advance(rig.clock.now())
    world.power(True)
    return "yes"


@_do_work.register
def _(question: Number, rig: Rig, world: AnyWorld) -> str | None:  # noqa: ARG001
    if not question.name.startswith("level-"):
        return None
    x_deg, y_deg = world.level_deg()
    shown_deg = round(x_deg if question.name.endswith("-x") else y_deg, 2)
    return f"{shown_deg + 0.0:.2f}"  # not -0.00


@_do_work.register
def _(question: Dial, rig: Rig, world: AnyWorld) -> str:
    """Turn the stage if needed, which takes time, and read the dial."""
    settings = rig.bench.instruments[question.stage].parse_settings()
    hand = Hand(world, question.stage, settings, rig.bench.seed)
    turn = None if question.expected is None else hand.turn_to(question.expected)
    if turn is not None:
        rig.clock.sleep(max(settings.seconds_per_move, turn.end_s - world.now_s))
        world.advance(rig.clock.now())
    return f"{hand.read_deg():.4f}"
