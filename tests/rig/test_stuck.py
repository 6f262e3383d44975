"""A stuck output: it is noticed when a pose is recorded, the poses since then are excluded, and are measured again."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.errors import SensorFault
from drivers.recorder import Samples
from drivers.transport.faults import Fault
from procedures.session import Pose
from rig.record import KeptPose, Record
from rig.runs.runner import resume, start
from rig.runs.stuck import StuckOutputs
from tests.rig.enduring import bench_for
from tests.rig.misbehaving import afflicted, included, short
from tests.rig.rigging import Onlooker, small_sweep
from tests.rig.test_wishes import Disturbed
from tests.slow import first_fast

RATE_HZ, DWELL = 100.0, 20  # samples of a dwell
TURNS = [Pose(90.0, beta_deg) for beta_deg in (0.0, 90.0, 180.0, 270.0)]
Noise = Callable[[int], NDArray[np.float64]]


def noise(sigma: float, seed: int = 1, filtered: float = 0.0) -> Noise:
    """Samples in steps of the resolution about 0, with a low-pass of this constant."""
    random = np.random.default_rng(seed)

    def samples(n: int) -> NDArray[np.float64]:
        white = random.normal(size=n)
        for k in range(1, n if filtered else 0):
            white[k] = filtered * white[k - 1] + np.sqrt(1 - filtered**2) * white[k]
        return sigma * white

    return samples


def dwell(values: NDArray[np.float64] | Sequence[float], number: int, channel: str = "ax") -> Samples:
    """A record of one output. Successive ones begin 10 s after each other."""
    return Samples(np.asarray(values, dtype=float).reshape(-1, 1), (channel,), RATE_HZ, 10.0 * number)


def noisy(outputs: StuckOutputs, dwells: int, sigma: float = 5.0, offset: float = 0.0) -> int:
    """Record poses of a sound output; returns the number of the next one."""
    samples = noise(sigma)
    for number in range(dwells):
        outputs.require_alive(TURNS[number % 4], dwell(np.round(samples(DWELL)) + offset, number))
    return dwells


def test_a_dwell_of_equal_samples_of_a_noisy_output_is_stuck() -> None:
    outputs = StuckOutputs()
    number = noisy(outputs, 8)
    with pytest.raises(SensorFault, match=r"adc: ax gave the same value 20 times .* 9\d % of the samples") as raised:
        outputs.require_alive(TURNS[0], dwell(DWELL * [7.0], number))
    assert raised.value.since_s == 10.0 * number


def test_equal_samples_at_the_end_of_a_pose_belong_to_the_stuck_ones() -> None:
    outputs = StuckOutputs()
    number = noisy(outputs, 8)
    outputs.require_alive(TURNS[0], dwell([1.0, 4.0, 2.0, -3.0, 9.0, *(5 * [7.0])], number))
    with pytest.raises(SensorFault, match="25 times") as raised:
        outputs.require_alive(TURNS[1], dwell(DWELL * [7.0], number + 1))
    assert raised.value.since_s == pytest.approx(10.0 * number + 0.05)


def test_an_output_that_is_stuck_in_the_middle_of_a_long_record_is_noticed() -> None:
    outputs = StuckOutputs()
    values = np.round(noise(2.0)(4000))
    outputs.require_alive(TURNS[0], dwell(values, 0))
    values[1000:1040] = values[1000]
    with pytest.raises(SensorFault, match="ax gave the same value 40 times") as raised:
        outputs.require_alive(TURNS[0], dwell(values, 1))
    assert raised.value.since_s == pytest.approx(20.0)


@pytest.mark.parametrize("sigma", [0.05, 0.15, 0.25, 0.4, 0.6, 1.0, 3.0])
@pytest.mark.parametrize("filtered", [0.0, 0.8])
def test_a_quiet_sensor_in_coarse_steps_is_not_stuck(sigma: float, filtered: float) -> None:
    """Its mean is anywhere between two steps: at a border it changes all the time, between two it is constant."""
    samples, place = noise(sigma, 2, filtered), np.random.default_rng(3)
    for _ in range(20):
        outputs = StuckOutputs()
        for number in range(60):
            offset = 0.5 if number < 10 else place.uniform(-0.5, 0.5)
            outputs.require_alive(Pose(0.0, 6.0 * number), dwell(np.round(samples(50) + offset), number))


def test_a_slow_motion_is_constant_at_its_turning_points() -> None:
    outputs, t_s = StuckOutputs("motion"), np.arange(4000) / RATE_HZ
    for number in range(3):
        outputs.require_alive(Pose(45.0, 90.0, path="motion"), dwell(np.round(400 * np.sin(0.4 * t_s)), number))


def test_samples_of_a_turn_are_not_used_for_the_noise_at_rest() -> None:
    outputs = StuckOutputs("rates")
    for number in range(8):
        outputs.require_alive(Pose(0, 0, rate_deg_s=20.0), dwell(np.round(noise(5.0)(DWELL)), number, "gx"))
    for number in range(8, 12):
        outputs.require_alive(Pose(0, 180), dwell(DWELL * [3.0], number, "gx"))


def test_a_turn_is_judged_by_the_noise_at_rest(golden) -> None:
    outputs = StuckOutputs("rates")
    for number in range(8):
        outputs.require_alive(Pose(0, 180.0 * number), dwell(np.round(noise(5.0)(DWELL)), number, "gx"))
    outputs.require_alive(Pose(0, 0, rate_deg_s=20.0), dwell(np.round(noise(5.0)(DWELL) + 700), 8, "gx"))
    with golden.refused(SensorFault):
        outputs.require_alive(Pose(0, 0, rate_deg_s=40.0), dwell(DWELL * [1400.0], 9, "gx"))


def test_poses_of_a_single_sample_do_not_show_the_noise() -> None:
    outputs = StuckOutputs()
    for number in range(300):
        outputs.require_alive(Pose(0.0, 0.1 * number), dwell([float(number)], number))
    for number in range(300, 400):
        outputs.require_alive(Pose(0.0, 40.0), dwell([300.0], number))


@pytest.mark.parametrize("channel", ["ax", "vx", "a1.vx"])
def test_equal_constant_values_at_different_forces_are_stuck_without_any_noise(channel: str) -> None:
    outputs = StuckOutputs()
    outputs.require_alive(TURNS[0], dwell(DWELL * [0.3], 0, channel))
    with pytest.raises(SensorFault, match=f"adc: {channel} gave the same value at 2 attitudes") as raised:
        outputs.require_alive(TURNS[1], dwell(DWELL * [0.3], 1, channel))
    assert raised.value.since_s == pytest.approx(0.1)  # the middle of the first of them


def test_small_steps_add_up_to_a_change_of_the_force() -> None:
    outputs = StuckOutputs()
    for number in range(2):  # -0.17 g
        outputs.require_alive(Pose(90.0, 90.0 + 10.0 * number), dwell(DWELL * [0.3], number))
    with pytest.raises(SensorFault, match="at 3 attitudes"):
        outputs.require_alive(Pose(90.0, 110.0), dwell(DWELL * [0.3], 2))


SOUND = {
    "an axis that gravity does not change": ([Pose(90.0, 10.0 * k) for k in range(36)], "az"),
    "the same pose": (5 * [Pose(90.0, 0.0)], "ax"),
    "both sides of the maximum": (2 * [Pose(90.0, 30.0), Pose(90.0, -30.0)], "ax"),
    "an axis beside the change": ([Pose(90.0, 85.0), Pose(90.0, 180.0 + 85.0)], "ax"),  # 0.17 g of 2 g
    "a gyroscope": (TURNS, "gx"),
    "the supply": (TURNS, "supply"),
}


@pytest.mark.parametrize("case", SOUND)
def test_a_constant_output_is_not_stuck_where_it_may_be_constant(case: str) -> None:
    poses, channel = SOUND[case]
    outputs = StuckOutputs()
    for number, pose in enumerate(poses):
        outputs.require_alive(pose, dwell(DWELL * [0.3], number, channel))


def test_the_poses_of_an_earlier_part_of_the_run_count() -> None:
    earlier = [
        KeptPose(pose, dwell(values, number), t_s=10.0 * number, temperature_c=None).dwell
        for number, (pose, values) in enumerate(
            zip(TURNS, [[1.0, 2.0], [0.1, 0.1], [0.1, 0.1], [3.0, 3.0]], strict=True)
        )
    ]
    outputs = StuckOutputs()
    outputs.recall(earlier[:3], zero_s=1000.0)
    with pytest.raises(SensorFault, match="at 3 attitudes") as raised:
        outputs.require_alive(TURNS[3], dwell(DWELL * [0.1], 3))
    assert raised.value.since_s == 1010.0
    sound = StuckOutputs()
    sound.recall(earlier, zero_s=1000.0)
    sound.require_alive(TURNS[0], dwell(DWELL * [0.1], 4))


# In a run.


@pytest.mark.sockets
def test_a_fault_with_a_time_excludes_the_poses_since_then_and_they_are_measured_again() -> None:
    with Record() as record:

        def stuck() -> None:
            fifth = watch.seen[4].samples
            raise SensorFault("adc: vx is stuck", "Look at it", fifth.start_s + 0.1)

        watch = Disturbed(stuck, "resume")
        bench = bench_for(False)
        whole = start(record, bench, *small_sweep(), Onlooker())
        outcome = start(record, bench, *small_sweep(), watch)
        assert outcome.run.state == "complete"
        kept = list(record.kept(outcome.run.run))
        assert [k.number for k in kept if k.excluded == "adc: vx is stuck"] == [4, 5, 6]
        again, sound = included(record, outcome.run.run), included(record, whole.run.run)
        assert [k.pose for k in again] == [k.pose for k in sound]
        means = [[list(k.dwell.means.values()) for k in each] for each in (again, sound)]
        np.testing.assert_allclose(*means, atol=1e-3)
        assert ("pose 4 excluded", "adc: vx is stuck") in [(e.what, e.text) for e in record.events(outcome.run.run)]


@pytest.mark.sockets
@pytest.mark.parametrize("place", first_fast(["first", "last"]))
def test_a_digital_sensor_that_is_stuck_from_the_first_or_in_the_last_pose_leaves_no_wrong_pose(place: str) -> None:
    bench = bench_for(False, "imu_lines")
    with Record() as record:
        sound = included(record, short(record, bench, "sweep").run.run)
        at_s = sound[0].samples.start_s - 1 if place == "first" else sound[-1].samples.start_s - 0.1
        outcome = short(record, afflicted(bench, "adc", Fault("stuck-axis", at_s=at_s)), "sweep")
        assert isinstance(outcome.error, SensorFault)
        wrong = [kept.number for kept in record.kept(outcome.run.run) if kept.excluded]
        assert wrong == (list(range(outcome.run.rows)) if place == "first" else [])
        assert outcome.run.rows == (len(wrong) or len(sound) - 1)
        done = resume(record, outcome.run.run, Onlooker(), bench)
        assert done.run.state == "complete"
        again = included(record, done.run.run)
        assert [k.pose for k in again] == [k.pose for k in sound]
        np.testing.assert_allclose(
            [k.dwell.means["ax"] for k in again], [k.dwell.means["ax"] for k in sound], atol=0.02
        )
