"""The meaning of each result of a run, in one sentence for a person who reads the table of results."""

from __future__ import annotations

import re

MEANINGS = {  # by the name of a result without its sensor; the first pattern that fits counts
    r"steady-state(-[xyz])?": "Steady: the drift stays within the tolerance.",
    r"steady-state-time.*": "Time after power-on from which the drift is within the tolerance.",
    r"steady-state-earliest.*": "Forecast: not earlier than this (97.5 %).",
    r"steady-state-latest.*": "Forecast: not later than this (97.5 %).",
    r"steady-state-expected.*": "Forecast: the most likely time.",
    r"bias-drift.*": "Change of the bias over the soak.",
    r"scale-drift.*": "Relative change of the scale factor over the soak.",
    r"(bias|scale)-tolerance.*": "A smaller change counts as steady.",
    r"time-constant.*": "Slowest time constant of the bias in warm-up.",
    r"scale-time-constant.*": "Slowest time constant of the scale factor in warm-up.",
    r"temperature-wander": "Range of the temperature after warm-up.",
    r"gap": "Total time without samples.",
    r"bias-final.*": "Bias after warm-up, as extrapolated.",
    r"scale-final.*": "Scale factor after warm-up, as extrapolated.",
    r"(bias|scale)-foreseen.*": "From this time after power-on the forecast was right.",
    r"noise-rms.*": "Rms noise of single samples at rest.",
    r"noise-pp.*": "Peak-to-peak noise: four times the rms noise.",
    r"inclination.*": "Smallest change of inclination that the noise does not hide.",
    r"rmse-(linear|physical)-x": r"Rms error of the model \1 in motion.",
    r"improvement-x": "Share of the linear model's error that the physical model removes.",
    r"noise-limit-x": "Rms error that the noise of the sensors alone gives.",
    r"amplitude": "Amplitude of the acceleration.",
    r"frequency": "Frequency of the motion.",
    r"level-offset.*": "Error of the level itself; the half turn removes it from the tilt.",
    r"level-[xyz]": "Tilt of the table along this axis of the level.",
    r"base-offset.*": "Error of the level itself; the half turn removes it from the tilt.",
    r"base-[xyz]": "Tilt of the base along this axis of the level.",
    r"theta-([xyz])([xyz])": r"Component of sensing axis \1 along reference axis \2.",
    r"(alpha|beta)-([xyz])": r"Angle \1 from the reference axis to sensing axis \2.",
    r"non-?orthogonality.*": "Departure of the angle between two sensing axes from 90 deg.",
    r"correction-([xyz])([xyz])": r"Factor of the measured \2 in the corrected \1.",
    r"rounds": "Rounds of the search.",
    r"(bias|scale)-as-is.*": "Scatter of repetitions without any change.",
    r"(bias|scale)-power.*": "Scatter of repetitions with power off and on in between.",
    r"(bias|scale)-mount.*": "Scatter of repetitions with a new mounting in between.",
    r"bias-temperature-hysteresis.*": "Bias on the way up less bias on the way down in temperature.",
    r"scale-temperature-hysteresis.*": "The same difference of the scale factor, relative.",
    r"bias-temperature.*": "Change of the bias for each kelvin.",
    r"scale-temperature.*": "Relative change of the scale factor for each kelvin.",
    r"reference-drift.*": "Trend of the output at the reference pose.",
    r"bias-[xyz]": "Output at zero input.",
    r"scale-[xyz]": "Output for each unit of input.",
    r"uncertainty": "Largest standard uncertainty of the results above, as an error at 1 g.",
    r"gyro-bias-rate-([xyz])": "The bias as a rate.",
    r"gyro-bias-[xyz]": "Output at rest.",
    r"gyro-scale-[xyz]": "Output for each deg/s.",
    r"gyro-misalignment-([xyz])([xyz])": r"Response of \1 to a turn about \2, as an angle.",
    r"gyro-g-sensitivity-([xyz])([xyz])": r"Response of \1 to a specific force along \2.",
    r"rate-residual.*": "Rms error that remains over all turns and rests.",
    r"hard-iron-by-hand.*": "Constant field of the sensor, from the extremes of each turn.",
    r"hard-iron.*": "Constant field of the sensor.",
    r"soft-iron-angle-by-hand": "Direction in which the field appears largest.",
    r"soft-iron-by-hand": "Smallest over largest radius of the turn about z.",
    r"soft-iron.*": "Relative distortion of the field by iron.",
    r"field-total": "Magnitude of the field.",
    r"field-horizontal(-by-hand)?": "Horizontal part of the field.",
    r"field-azimuth(-by-hand)?": "Direction of magnetic north, clockwise from the x axis of the base.",
    r"field-declination": "Magnetic north, clockwise from true north.",
    r"field-inclination": "Angle of the field below the horizontal.",
    r"left-by-(ellipsoid|hand)": "Error of the magnitude that remains, in thousandths of the field.",
}


def meaning(name: str) -> str:
    """One sentence on a result; "" for a result that a procedure of a user names itself."""
    base_name = name.rpartition("/")[2]
    matches = ((re.fullmatch(pattern, base_name), text) for pattern, text in MEANINGS.items())
    return next((match.expand(text) for match, text in matches if match), "")
