"""motion: shake the sensor along its x axis beside a displacement sensor.

Excites   scale factor in motion, output filter, sampling delay; all that a model of the standing sensor misses.
Blind to  motion along y and z, and frequencies other than the one that it is shaken with.
Source    Ang V, Fig. 12: alpha = 45, beta = 90 deg, 60 um peak to peak at 10 Hz along x, which is horizontal.

A short sweep of the same sensor comes first, so that the models that are judged are its own, and of this hour. Before
the sweep and before the motion a stage swings about its place, each time by less, as one demagnetises: friction forgets
from where the sensor came, and its springs stand between the branches of their hysteresis.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain

from procedures.errors import ProcedureError, SettingError
from procedures.level_check import levelled
from procedures.session import Pose, Session, Stage
from procedures.sweep import turn

KIND = "motion"
SWEEP, STILL = "sweep", "still"  # paths of the poses begin with what they are for
DISPLACEMENT = "d63"  # the converter's channel
ALPHA_DEG, BETA_DEG = 45.0, 90.0
INCLINATIONS_DEG, STEP_DEG = (90.0, 45.0, 135.0), 45.0  # enough for the physical model, as a measurement showed
SWINGS_DEG = tuple(90 * 0.85**k for k in range(24))  # 60 deg, or steps of 0.7, leave 2 mm/s^2 of hysteresis: measured
SHAKING_S = 1.0  # from the start of the motion on, until only the motion is left
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
    """Sweep, then record the sensor still for `still_s` and shaken for `duration_s`, without a gap in either.

    Shaken at several frequencies, one after the other, it also tells a corner of the output filter from a delay; the
    models are judged at the first.
    """
    widths_and_times = (peak_to_peak_um, *frequency_hz, duration_s, still_s, block_s, dwell_s)
    if not frequency_hz or min(widths_and_times) <= 0 or settle_s < 0:
        raise SettingError("motion: give a width, frequencies and times above 0, and a settle_s not below")
    _require_displacement(rig)
    rig.confirm(
        "mounting",
        "Is the sensor on the nano-positioner, face up and its x along the carriage's x, the tip of the displacement "
        "sensor behind the carriage, and are both cables free to turn?",
        drawing="face-up",
    )
    levelled(rig)
    calibration, still = list(sweep()), blocks(STILL, still_s, block_s)
    shaken = {hz: blocks(f"{KIND} {hz:g} Hz", duration_s, block_s) for hz in frequency_hz}
    left = list(rig.missing([*calibration, *still, *chain(*shaken.values())]))
    _stand(rig, centre_um)
    if calibration[0] in left:
        _start_without_history(rig)
    for pose in _of(left, calibration):
        rig.hold(pose, dwell_s, settle_s)
    _settle_between_branches(rig)
    rig.wait(settle_s)
    if now := _of(left, still):
        rig.host.doing(f"recording for {len(now) * block_s:g} s, still")
        rig.keep_stretch(now, block_s)
    for hz, poses in shaken.items():
        if now := _of(left, poses):
            with _shaking(rig, peak_to_peak_um, hz, centre_um):
                rig.keep_stretch(now, block_s)


def sweep() -> Iterator[Pose]:
    """The poses that the models are fitted to: full turns both ways at three inclinations."""
    for alpha_deg in INCLINATIONS_DEG:
        yield from turn(alpha_deg, 0, 360, STEP_DEG, f"{SWEEP} A+ to B-")
        yield from turn(alpha_deg, 360, 0, STEP_DEG, f"{SWEEP} B+ to A-")


def blocks(what: str, duration_s: float, block_s: float) -> list[Pose]:
    """A record at the attitude of the motion, block by block."""
    return [Pose(ALPHA_DEG, BETA_DEG, 0, f"{what} {k}") for k in range(max(1, round(duration_s / block_s)))]


def _of(left: Sequence[Pose], part: Sequence[Pose]) -> list[Pose]:
    """What is left of a part."""
    return [pose for pose in left if pose in part]


def _require_displacement(rig: Session) -> None:
    """Raises ProcedureError before anything moves."""
    if DISPLACEMENT not in rig.adc.acquire(0.1).channels:
        raise ProcedureError(
            f"motion: the adc has no channel {DISPLACEMENT} for the displacement sensor; name it in "
            "the bench file's channels"
        )


def _stand(rig: Session, centre_um: float) -> None:
    """Put the carriage to its centre, whatever an interrupted run left it doing."""
    rig.host.doing(f"positioner to {centre_um:g} um")
    rig.positioner.stop()
    rig.positioner.servo(True)
    rig.positioner.move_to(AXIS, centre_um)


def _start_without_history(rig: Session) -> None:
    """Home, both axes swung alike: from here on, the way of the sensor is known."""
    rig.host.doing("swinging alpha ever less, so that the sensor forgets where it was")
    rig.beta.move_to(45.0)
    _fade(rig.alpha, 0.0)
    rig.beta.move_to(0.0)


def _settle_between_branches(rig: Session) -> None:
    """At the attitude of the motion."""
    rig.host.doing(f"swinging beta ever less about {BETA_DEG:g} deg, so that the sensor forgets from where it came")
    rig.alpha.move_to(ALPHA_DEG)
    _fade(rig.beta, BETA_DEG)


def _fade(stage: Stage, about_deg: float) -> None:
    for k, swing_deg in enumerate(SWINGS_DEG):
        stage.move_to(round(about_deg + (swing_deg if k % 2 else -swing_deg), 1))
    stage.move_to(about_deg)


@contextmanager
def _shaking(rig: Session, peak_to_peak_um: float, frequency_hz: float, centre_um: float) -> Iterator[None]:
    """Inside, the carriage swings; however it ends, it stands still afterwards."""
    try:
        really_hz = rig.positioner.oscillate(
            AXIS, peak_to_peak_um=peak_to_peak_um, frequency_hz=frequency_hz, centre_um=centre_um
        )
        rig.host.doing(f"shaking {AXIS} by {peak_to_peak_um:g} um peak to peak at {really_hz:.6g} Hz")
        rig.wait(SHAKING_S)
        yield
    finally:
        rig.positioner.stop()
