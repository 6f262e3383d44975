"""motion: shake the sensor along its x axis and measure the displacement at the same time.

Excites   scale factor in motion, output filter, sampling delay; errors that a model of the still sensor does not have.
Blind to  motion along y and z; all frequencies other than the frequency of the motion.
Source    Ang V, Fig. 12: alpha = 45, beta = 90 deg, 60 um peak to peak at 10 Hz along x, which is horizontal.

A short sweep of the same sensor comes first, so the models are fitted to this sensor and this hour. Before the sweep
and before the motion a stage swings with falling amplitude, as in demagnetisation. This removes the history of
friction: the springs come to rest between the branches of their hysteresis.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain

from procedures.bounds import count_parts, require_bounded
from procedures.errors import ProcedureError, SettingError
from procedures.instruments import Stage
from procedures.level_check import prepare
from procedures.session import Pose, Session
from procedures.sweep import turn

KIND = "motion"
SWEEP, STILL = "sweep", "still"  # first words of the paths
DISPLACEMENT = "d63"  # the converter's channel
ALPHA_DEG, BETA_DEG = 45.0, 90.0
INCLINATIONS_DEG, STEP_DEG = (90.0, 45.0, 135.0), 45.0  # enough for the physical model: measured
SWINGS_DEG = tuple(90 * 0.85**k for k in range(24))  # 60 deg, or a ratio of 0.7, leaves hysteresis of 2 mm/s^2
SHAKING_S = 1.0  # from the start of the motion until the transient has decayed
AXIS = "x"


def motion(
    rig: Session,
    *,
    peak_to_peak_um: float = 60.0,
    frequency_hz: tuple[float, ...] = (10.0,),
    centre_um: float = 50.0,
    duration_s: float = 60.0,
    still_s: float = 30.0,
    block_s: float = 10.0,
    dwell_s: float = 2.0,
    settle_s: float = 0.5,
) -> None:
    """Sweep, then record the sensor still and in motion. The records have no gaps.

    peak_to_peak_um  The travel of the positioner along x.
    frequency_hz     The frequencies of the sine, one after another. Several frequencies separate a corner of the output
                     filter from a delay. The first one is that of the comparison of the models.
    centre_um        The position in the range of the positioner about which the sensor moves.
    duration_s       How long the motion is recorded at each frequency.
    still_s          How long the still sensor is recorded.
    """
    positive = (peak_to_peak_um, *frequency_hz, duration_s, still_s, block_s, dwell_s)
    if not frequency_hz or min(positive) <= 0 or settle_s < 0:
        raise SettingError("motion: amplitude, frequencies and times must be above 0, settle_s must be 0 or more")
    if not rig.measured():
        _require_displacement(rig)
    prepare(
        rig,
        "Is the sensor on the nano-positioner, face up, its x axis along the carriage's x? Is the tip of the "
        "displacement sensor behind the carriage? Can both cables turn freely?",
    )
    calibration, still = list(sweep()), blocks(STILL, still_s, block_s)
    motions = {hz: blocks(f"{KIND} {hz:g} Hz", duration_s, block_s) for hz in frequency_hz}
    later = [*still, *chain(*motions.values())]
    missing = list(rig.missing([*calibration, *later]))
    in_sweep = calibration[0] not in missing and _missing_in_part(missing, later) == later
    if not in_sweep:
        _centre_carriage(rig, centre_um)
    if calibration[0] in missing:
        _remove_history(rig)
    for pose in _missing_in_part(missing, calibration):
        rig.hold(pose, dwell_s, settle_s)
    if in_sweep:  # after the sweep, so that a resumed sweep has the same steps as an undisturbed one
        _centre_carriage(rig, centre_um)
    _remove_hysteresis(rig)
    rig.wait(settle_s)
    if todo := _missing_in_part(missing, still):
        rig.host.doing(f"recording the still sensor for {len(todo) * block_s:g} s")
        rig.keep_stretch(todo, block_s)
    for hz, poses in motions.items():
        if todo := _missing_in_part(missing, poses):
            with _oscillation(rig, peak_to_peak_um, hz, centre_um):
                rig.keep_stretch(todo, block_s)


def sweep() -> Iterator[Pose]:
    """The poses for the fit of the models: full turns of beta in both directions at three inclinations."""
    for alpha_deg in INCLINATIONS_DEG:
        yield from turn(alpha_deg, 0, 360, STEP_DEG, f"{SWEEP} A+ to B-")
        yield from turn(alpha_deg, 360, 0, STEP_DEG, f"{SWEEP} B+ to A-")


def blocks(path: str, duration_s: float, block_s: float) -> list[Pose]:
    """The blocks of a record at the attitude of the motion."""
    return require_bounded(Pose(ALPHA_DEG, BETA_DEG, 0, f"{path} {k}") for k in range(count_parts(duration_s, block_s)))


def _missing_in_part(missing: Sequence[Pose], part: Sequence[Pose]) -> list[Pose]:
    """The missing poses of one part of the run."""
    return [pose for pose in missing if pose in part]


def _require_displacement(rig: Session) -> None:
    """Raises ProcedureError before anything moves."""
    if DISPLACEMENT not in rig.adc.acquire(0.1).channels:
        raise ProcedureError(
            f"motion: the adc has no channel {DISPLACEMENT} for the displacement sensor; add it to channels in the "
            "bench file"
        )


def _centre_carriage(rig: Session, centre_um: float) -> None:
    """Stop the carriage, which an interrupted run may have left in motion, and move it to its centre."""
    rig.host.doing(f"positioner to {centre_um:g} um")
    rig.positioner.stop()
    rig.positioner.servo(True)
    rig.positioner.move_to(AXIS, centre_um)


def _remove_history(rig: Session) -> None:
    """Swing both axes of the sensor at home: from here on the history of the sensor is known."""
    rig.host.doing("swinging alpha with falling amplitude to remove hysteresis")
    rig.beta.move_to(45.0)
    _fade(rig.alpha, 0.0)
    rig.beta.move_to(0.0)


def _remove_hysteresis(rig: Session) -> None:
    """Swing the sensor at the attitude of the motion."""
    rig.host.doing(f"swinging beta about {BETA_DEG:g} deg with falling amplitude to remove hysteresis")
    rig.alpha.move_to(ALPHA_DEG)
    _fade(rig.beta, BETA_DEG)


def _fade(stage: Stage, centre_deg: float) -> None:
    """Swing `stage` about an angle with falling amplitude."""
    for k, swing_deg in enumerate(SWINGS_DEG):
        stage.move_to(round(centre_deg + (swing_deg if k % 2 else -swing_deg), 1))
    stage.move_to(centre_deg)


@contextmanager
def _oscillation(rig: Session, peak_to_peak_um: float, frequency_hz: float, centre_um: float) -> Iterator[None]:
    """The carriage oscillates inside the context. It always stops at the end."""
    try:
        actual_hz = rig.positioner.oscillate(
            AXIS, peak_to_peak_um=peak_to_peak_um, frequency_hz=frequency_hz, centre_um=centre_um
        )
        rig.host.doing(f"shaking {AXIS} by {peak_to_peak_um:g} um peak to peak at {actual_hz:.6g} Hz")
        rig.wait(SHAKING_S)
        yield
    finally:
        rig.positioner.stop()
