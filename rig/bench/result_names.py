"""The results of procedures: their names, on which a bench file may set limits, and the meaning of each in a sentence.

`rig.results` computes them. A user's own procedure names its results itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations, permutations, product

AXES = "xyz"


def _names_of_axes(meanings: Mapping[str, str]) -> dict[str, str]:
    """Names in which `{axis}` stands for any axis, each written for all axes."""
    return {name.format(axis=axis): meaning for name, meaning in meanings.items() for axis in AXES}


def _names_of_pairs(name: str, meaning: str, pairs: Iterable[Sequence[str]]) -> dict[str, str]:
    """A name that ends with two axes, written for all pairs; `{0}` and `{1}` of its meaning are the axes."""
    return {f"{name}-{first}{second}": meaning.format(first, second) for first, second in pairs}


LEVEL_OFFSET = "Error of the level itself; the half turn removes it from the tilt."
BIAS, SCALE = "Output at zero input.", "Output for each unit of input."
BETWEEN = "Departure of the angle between the sensing axes {0} and {1} from 90 deg."
NONORTHOGONALITY = "Departure of the angle between two sensing axes from 90 deg."
HARD_IRON, SOFT_IRON = "Constant field of the sensor.", "Relative distortion of the field by iron, {0}{1}."
SOFT_IRON_PAIRS = ("xx", "yy", "xy", "xz", "yz")
FIELD = "Magnitude of the field."
MAGNITUDE_ERROR = "Error of the magnitude that remains, in thousandths of the field."
STEADY_STATE = {
    "steady-state": "Steady state: the drift stays within the tolerance.",
    "steady-state-time": "Time after power-on from which the drift is within the tolerance.",
    "steady-state-earliest": "Forecast: not earlier than this (97.5 %).",
    "steady-state-expected": "Forecast: the most likely time.",
    "steady-state-latest": "Forecast: not later than this (97.5 %).",
}
NORTH = "Direction of magnetic north, clockwise from the x axis of the base."

RESULTS: Mapping[str, Mapping[str, str]] = {  # name -> meaning, by procedure
    "check-standard": _names_of_axes({"bias-{axis}": BIAS, "scale-{axis}": SCALE}),
    "hand-positions": {
        **_names_of_axes({"bias-{axis}": BIAS, "scale-{axis}": SCALE}),
        **_names_of_pairs("nonorthogonality", BETWEEN, combinations(AXES, 2)),
        "uncertainty": "Largest standard uncertainty of the results above, as an error at 1 g.",
    },
    "hand-fields": {
        **_names_of_axes({"hard-iron-{axis}": HARD_IRON}),
        **_names_of_pairs("soft-iron", SOFT_IRON, SOFT_IRON_PAIRS),
        "field-total": FIELD,
        "left-by-ellipsoid": MAGNITUDE_ERROR,
        "uncertainty": "Largest standard uncertainty of the results above, as a share of the field.",
    },
    "hand-turns": {
        **_names_of_axes({"gyro-bias-{axis}": "Output at rest.", "gyro-scale-{axis}": "Output for each deg/s."}),
        **_names_of_pairs(
            "gyro-misalignment", "Response of {0} to a turn about {1}, as an angle.", permutations(AXES, 2)
        ),
        "turn-residual": "Rms error of the angles of the turns over their duration.",
        "uncertainty": "Largest standard uncertainty of a scale factor, or of a misalignment in rad.",
    },
    "level-check": _names_of_axes(
        {
            "level-{axis}": "Tilt of the table along this axis of the level.",
            "level-offset-{axis}": LEVEL_OFFSET,
            "base-{axis}": "Tilt of the base along this axis of the level.",
            "base-offset-{axis}": f"{LEVEL_OFFSET.removesuffix('.')} of the base.",
        }
    ),
    "magnetometer-turn": {
        **_names_of_axes(
            {
                "hard-iron-{axis}": HARD_IRON,
                "hard-iron-by-hand-{axis}": "Constant field of the sensor, from the extremes of each turn.",
            }
        ),
        "soft-iron-by-hand": "Smallest over largest radius of the turn about z.",
        "soft-iron-angle-by-hand": "Direction in which the field appears largest.",
        **_names_of_pairs("soft-iron", SOFT_IRON, SOFT_IRON_PAIRS),
        "field-total": FIELD,
        "field-inclination": "Angle of the field below the horizontal.",
        "field-declination": "Magnetic north, clockwise from true north.",
        "field-horizontal": "Horizontal part of the field.",
        "field-horizontal-by-hand": "Horizontal part of the field, from the extremes of the turn.",
        "field-azimuth": NORTH,
        "field-azimuth-by-hand": f"{NORTH.removesuffix('.')}, from the extremes of the turn.",
        "left-by-ellipsoid": MAGNITUDE_ERROR,
        "left-by-hand": f"{MAGNITUDE_ERROR.removesuffix('.')}, with the values from the extremes of each turn.",
    },
    "misalignment": {
        **_names_of_pairs("theta", "Component of sensing axis {0} along reference axis {1}.", product("xy", AXES)),
        **{
            f"{angle}-{axis}": f"Angle {angle} from the reference axis to sensing axis {axis}."
            for angle in ("alpha", "beta")
            for axis in AXES
        },
        "non-orthogonality": NONORTHOGONALITY,
        "rounds": "Rounds of the search.",
        **_names_of_pairs("correction", "Factor of the measured {1} in the corrected {0}.", product(AXES, repeat=2)),
    },
    "motion": {
        "rmse-linear-x": "Rms error of the model linear in motion.",
        "rmse-physical-x": "Rms error of the model physical in motion.",
        "improvement-x": "Share of the linear model's error that the physical model removes.",
        "noise-limit-x": "Rms error that the noise of the sensors alone gives.",
        "amplitude": "Amplitude of the acceleration.",
        "frequency": "Frequency of the motion.",
    },
    "noise-floor": _names_of_axes(
        {
            "noise-rms-{axis}": "Rms noise of single samples at rest.",
            "noise-pp-{axis}": "Peak-to-peak noise: four times the rms noise.",
            "inclination-{axis}": "Smallest change of inclination that the noise does not hide.",
        }
    ),
    "rate-turn": {
        **_names_of_axes(
            {
                "gyro-bias-{axis}": "Output at rest.",
                "gyro-bias-rate-{axis}": "The bias as a rate.",
                "gyro-scale-{axis}": "Output for each deg/s.",
                "rate-residual-{axis}": "Rms error that remains over all turns and rests.",
            }
        ),
        **_names_of_pairs(
            "gyro-misalignment", "Response of {0} to a turn about {1}, as an angle.", permutations(AXES, 2)
        ),
        **_names_of_pairs(
            "gyro-g-sensitivity", "Response of {0} to a specific force along {1}.", product(AXES, repeat=2)
        ),
    },
    "repeat": _names_of_axes(
        {
            f"{short}-{kind}-{{axis}}": f"Scatter of the {quantity} over repetitions {change}."
            for short, quantity in (("bias", "bias"), ("scale", "scale factor"))
            for kind, change in {
                "as-is": "without any change",
                "power": "with power off and on in between",
                "mount": "with a new mounting in between",
            }.items()
        }
    ),
    "soak": {
        **STEADY_STATE,
        **_names_of_axes({f"{name}-{{axis}}": meaning for name, meaning in STEADY_STATE.items()}),
        **_names_of_axes(
            {
                "bias-drift-{axis}": "Change of the bias over the soak.",
                "scale-drift-{axis}": "Relative change of the scale factor over the soak.",
                "bias-tolerance-{axis}": "A smaller change of the bias counts as steady.",
                "scale-tolerance-{axis}": "A smaller relative change of the scale factor counts as steady.",
                "time-constant-{axis}": "Slowest time constant of the bias in warm-up.",
                "scale-time-constant-{axis}": "Slowest time constant of the scale factor in warm-up.",
                "bias-final-{axis}": "Bias after warm-up, as extrapolated.",
                "scale-final-{axis}": "Scale factor after warm-up, as extrapolated.",
                "bias-foreseen-{axis}": "Time after power-on from which the forecast of the bias was right.",
                "scale-foreseen-{axis}": "Time after power-on from which the forecast of the scale factor was right.",
            }
        ),
        "temperature-wander": "Range of the temperature after warm-up.",
        "gap": "Total time without samples.",
    },
    "sweep": _names_of_axes({"reference-drift-{axis}": "Trend of the output at the reference pose."}),
    "temperature-cycle": _names_of_axes(
        {
            "bias-temperature-{axis}": "Change of the bias for each kelvin.",
            "bias-temperature-hysteresis-{axis}": "Bias at rising temperature minus bias at falling temperature.",
            "scale-temperature-{axis}": "Relative change of the scale factor for each kelvin.",
            "scale-temperature-hysteresis-{axis}": "Relative difference of the scale factor, rising minus falling.",
        }
    ),
}


def meaning(procedure: str, name: str) -> str:
    """One sentence on a result, whose sensor may precede its name; "" if a procedure of a user names it."""
    return RESULTS.get(procedure, {}).get(name.rpartition("/")[2], "")


def label(procedure: str, name: str) -> str:
    """A result in words: its meaning, the axis, and the sensor of a batch; its name if a procedure of a user names it.

    `bias-drift-x` of a soak is `Change of the bias over the soak, axis x`.
    """
    sensor, _, short = name.rpartition("/")
    text = meaning(procedure, name).removesuffix(".")
    if not text:
        return name
    axis = short[-1] if short[-2:-1] == "-" and short[-1] in AXES else ""
    of_axis = f", axis {axis}" if axis and f"axis {axis}" not in text else ""
    return f"{f'{sensor}: ' if sensor else ''}{text}{of_axis}"


def names_with_limits() -> list[str]:
    """The names that a bench file may limit, in alphabetical order: results, and parameters on certificates."""
    # the catalogue loads slowly, and few bench files have such limits
    from calibrations.effects.catalogue import catalogue
    from calibrations.presentation.certificate.terms import names as certificate_names

    parameters = {name for effect in catalogue().values() for name in certificate_names(effect)}
    return sorted(parameters.union(*RESULTS.values()))
