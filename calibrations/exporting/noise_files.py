"""Noise of an inertial measurement unit for Kalibr and OpenVINS: white noise and random walk of the bias.

Both take continuous densities: white noise N, Allan deviation at 1 s, and rate random walk K, Allan deviation at 3 s on
its line. Both multiply N by the root of the rate to get the noise of a sample. One number serves all three axes: the
largest. Other processes cannot be in the file; their error is their largest Allan deviation.

Source  Kalibr: IMU noise model; OpenVINS: gs-calibration; IEEE Std 952, annex C.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from calibrations.errors import ModelError
from calibrations.exporting.linear_form import unit_factor
from calibrations.exporting.simulated import ExportedFile, Loss, gravity_of
from calibrations.model import Model
from calibrations.table import STANDARD_GRAVITY

WHITE, WALK = "white-noise", "rate-random-walk"
SENSORS = {"accelerometer": ("m/s^2", "g", STANDARD_GRAVITY), "gyroscope": ("rad/s", "deg/s", 0.0174532925199432957)}
FLICKER_DEVIATION = 0.664  # Allan deviation of flicker noise with coefficient 1
MARKOV_DEVIATION = 0.62  # largest one of a Gauss-Markov process with standard deviation 1
WHY = "the format has white noise and a random walk"


@dataclass(frozen=True)
class ExportSettings:
    """The topic and the rate of the measurements; random walks that the user states, by sensor, in SI units."""

    topic: str
    rate_hz: float
    walks: Mapping[str, float]


def kalibr(models: Sequence[Model], settings: ExportSettings, comment: str) -> ExportedFile:
    """The file imu.yaml of Kalibr."""
    numbers, losses, notes = _densities(models, settings, "kalibr")
    lines = [f"# {comment}", *_lines(numbers), f"rostopic: {settings.topic}", f"update_rate: {settings.rate_hz:.6g}"]
    return ExportedFile("\n".join(lines) + "\n", losses, notes)


def openvins(models: Sequence[Model], settings: ExportSettings, comment: str) -> ExportedFile:
    """The file kalibr_imu_chain.yaml of OpenVINS, with ideal intrinsics: calibrate the measurements before."""
    numbers, losses, notes = _densities(models, settings, "openvins")
    unit_rows = ["    - [1.0, 0.0, 0.0]", "    - [0.0, 1.0, 0.0]", "    - [0.0, 0.0, 1.0]"]
    zeros = ["    - [0.0, 0.0, 0.0]"] * 3
    lines = ["%YAML:1.0", f"# {comment}", "", "imu0:"]
    lines += ["  T_i_b:", *(f"    - [{', '.join('1.0' if i == k else '0.0' for k in range(4))}]" for i in range(4))]
    lines += [f"  {line}" for line in _lines(numbers)]
    lines += [f"  rostopic: {settings.topic}", "  time_offset: 0.0", f"  update_rate: {settings.rate_hz:.1f}"]
    lines += ['  model: "kalibr"']
    for name in ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC"):
        lines += [f"  {name}:", *unit_rows]
    lines += ["  Tg:", *zeros]
    ideal = "The file has ideal axes and scale factors: give OpenVINS measurements that are already compensated."
    return ExportedFile("\n".join(lines) + "\n", losses, (*notes, ideal))


def _lines(numbers: Mapping[str, float]) -> Iterator[str]:
    for name, value in numbers.items():
        yield f"{name}: {value:.6e}"  # with a point: YAML readers take 4e-6 for a text


def _densities(
    models: Sequence[Model], settings: ExportSettings, program: str
) -> tuple[dict[str, float], tuple[Loss, ...], tuple[str, ...]]:
    """The four densities by name, the losses, and remarks. Raises ModelError if a sensor is missing."""
    by_sensor: dict[str, Model] = {}
    for model in models:
        if (sensor := _sensor(model)) in by_sensor:
            raise ModelError(f"{program}: {by_sensor[sensor].name} and {model.name} are both a noise of the {sensor}")
        by_sensor[sensor] = model
    if missing := [sensor for sensor in SENSORS if sensor not in by_sensor]:
        raise ModelError(
            f"{program}: the file needs the noise of the {missing[0]} as well; fit a still record of it, "
            f"`rig discover DATA --out noise.yaml`, and give both models"
        )
    numbers: dict[str, float] = {}
    losses: list[Loss] = []
    notes: list[str] = []
    for sensor in SENSORS:
        model = by_sensor[sensor]
        factor = _factor(model, sensor)
        white, walk = (factor * _largest_value(model, name) for name in (WHITE, WALK))
        if stated_walk := settings.walks.get(sensor):
            walk = stated_walk
        if not walk:
            raise ModelError(
                f"{model.name}: has no {WALK}, and {program} refuses 0; record longer and fit a model with {WALK}, "
                f"or give --{sensor}-random-walk VALUE in {SENSORS[sensor][0]}/s/sqrt(Hz)"
            )
        if not white:
            raise ModelError(f"{model.name}: has no {WHITE}, and {program} refuses 0; fit it with {WHITE}")
        numbers |= {f"{sensor}_noise_density": white, f"{sensor}_random_walk": walk}
        losses += _other_processes(model, sensor, factor)
        notes += _axes(model, sensor)
    return numbers, tuple(losses), tuple(notes)


def _sensor(model: Model) -> str:
    if not any(e.value for name in (WHITE, WALK) for e in model.estimates(name)):
        raise ModelError(
            f"{model.name}: has no noise; fit a still record: `rig discover DATA --model still --out noise.yaml`"
        )
    for sensor, (unit, _, _) in SENSORS.items():
        if unit_factor(model.unit, unit, STANDARD_GRAVITY):
            return sensor
    raise ModelError(
        f"{model.name}: its outputs are in {model.unit or 'an unknown unit'}; the file needs m/s^2, g, rad/s or deg/s. "
        "Convert the still record with the sensor's scale factor before the fit"
    )


def _factor(model: Model, sensor: str) -> float:
    return unit_factor(model.unit, SENSORS[sensor][0], gravity_of(model)) or 1.0


def _largest_value(model: Model, effect: str) -> float:
    return max((e.value for e in model.estimates(effect) if e.identified), default=0.0)


def _other_processes(model: Model, sensor: str, factor: float) -> Iterator[Loss]:
    """Every other process, as its largest Allan deviation in g or deg/s."""
    _, unit, per = SENSORS[sensor]
    for term in model.terms:
        if term.name in (WHITE, WALK) or not term.estimates:
            continue
        if term.name == "flicker-noise":
            size = FLICKER_DEVIATION * _largest_value(model, term.name)
        elif term.name == "gauss-markov-noise":
            size = MARKOV_DEVIATION * max((e.value for e in term.estimates if e.name == "sigma"), default=0.0)
        else:
            yield Loss(f"{term.name} of the {sensor}", WHY, None, None, unit)
            continue
        yield Loss(f"{term.name} of the {sensor}", WHY, factor * size / per, factor * size / per, unit)


def _axes(model: Model, sensor: str) -> Iterator[str]:
    for name in (WHITE, WALK):
        values = {e.axis: e.value for e in model.estimates(name) if e.identified and e.value}
        if len(values) > 1 and max(values.values()) > 1.1 * min(values.values()):
            least = min(values, key=lambda axis: values[axis])
            share = values[least] / max(values.values())
            yield f"One {name} of the {sensor} for all axes: the largest. That of {least} is {share:.2g} of it."
