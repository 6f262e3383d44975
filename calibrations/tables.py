"""The kinds of measured data: a class for each, with its differences from the others.

The residual of each kind is in `calibrations.fitting.problem_kinds`, its charts in `calibrations.presentation.charts`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType


class Kind:
    """One kind of data. Members have the value that most kinds share; a subclass gives its own."""

    name: str  # as effects and models are defined for it
    file: str  # kind of data file that holds it
    columns: tuple[tuple[str, ...], ...]  # sets of columns, of which one must be complete
    outputs: tuple[str, ...] = ()  # columns of the outputs, in the order of the axes x, y, z
    digital: tuple[str, ...] = ()  # the same of a sensor whose outputs are not in V: the table states their unit
    unit: str = ""  # of the outputs; "" where each table gives its own
    input_unit: str = "g"  # of the sensed quantity
    default_model: str = "linear"

    rows: str  # what its rows are called
    size_in: str  # the unit of the size of a table, in words

    symbol: str = "a"  # of the sensed quantity
    sensed_in: str = "g"  # what its magnitude is given in
    sensed_along: str = "specific force along {} (g)"  # its component along an axis
    nearest_to: str = "gravity"  # the direction that distinguishes rows
    drawn_over: tuple[str, str, str] | None = None  # name, label and column that charts draw its rows over
    measurement_caption: str  # of the picture of measurement beside {model}
    failure_caption: str  # of the picture of where {model} fails
    taken: str = "the means of {} still positions"  # the rows that a log of raw samples gave, by their number
    perfect_sensor: str = "the linear model"  # the reference in the picture of an effect
    nominal: str = " of 1 V/g"  # the sensor in that picture
    widest_form: str = ""  # whose residual is the noise where the rows give none
    note: str = ""  # what else judges such data, in words

    fitted: bool = True  # whether models are fitted to its rows by least squares
    means: bool = False  # whether a row is the mean of samples in one orientation or at one rate
    budget: bool = False  # whether a report draws up an uncertainty budget
    known_input: bool = False  # whether each row has a known specific force or rate: the residual is in the output
    stage_angles: bool = False  # whether stages gave each row its orientation
    moving: bool = False  # whether the sensor moves: its output filter matters, and rows are stretches that repeat
    from_output: bool = False  # a model computes the sensed quantity from the output, and the residual is in its unit
    turning: bool = False  # whether the sensor turns at a constant rate, and senses it
    magnitude: bool = False  # whether only the magnitude of the sensed quantity is known
    field: bool = False  # whether that is a field, whose strength is a parameter
    same_pose: tuple[str, ...] = ()  # columns whose values make two rows the same pose
    overlapping: bool = False  # whether a sample may be in two rows, with its time
    fewest_for_form: int = 24  # rows that can show a free form: the base of poses of two axes has ten parameters
    sequential: bool = True  # whether rows without times are taken as one second apart


class Poses(Kind):
    """Poses of a rig with stages: gravity along each axis is known."""

    name = file = rows = size_in = "poses"
    columns = (("alpha_deg", "beta_deg", "vx_v"), ("alpha_deg", "beta_deg", "ax"))
    outputs = ("vx_v", "vy_v", "vz_v")
    digital = ("ax", "ay", "az")
    unit = "V"
    taken = "the means of {} poses"
    means = budget = known_input = stage_angles = True
    same_pose = ("alpha_deg", "beta_deg", "mount_deg", "flip")
    drawn_over = ("beta", "β (deg)", "beta_deg")
    measurement_caption = (
        "Dots are measured, lines are the model {}. "
        "Filled markers are clockwise approaches, open ones anticlockwise approaches."
    )
    failure_caption = "The residual of the model {} at both stage angles; pale is near the noise."


class Positions(Kind):
    """Positions of an accelerometer: only the magnitude of gravity is known."""

    name = file = rows = size_in = "positions"
    columns = (("ax", "ay", "az"), ("mx", "my", "mz"))
    outputs = ("ax", "ay", "az")
    default_model = "common-scale"
    means = budget = magnitude = from_output = True
    measurement_caption = "The magnitude of gravity by the model {} at each position: 1 g if the model is right."
    failure_caption = "The residual of the model {} over the direction of gravity; pale is near the noise."


class Fields(Positions):
    """Positions of a magnetometer: only the magnitude of the field is known, and that as 1."""

    name = "fields"
    outputs = ("mx", "my", "mz")
    input_unit = "field"
    perfect_sensor = "a magnetometer without error"
    nominal = " in a field of 1"
    taken = "{} samples, one for each direction of the field"
    default_model = "field"
    field = True
    sequential = False
    widest_form = "an ellipsoid"
    symbol = "m"
    sensed_in = "share of the field"
    sensed_along = "share of the field along {}"
    nearest_to = "the field"
    measurement_caption = "The magnitude of the field by the model {} at each position: 1 if the model is right."
    failure_caption = "The residual of the model {} over the direction of the field; pale is near the noise."


class Rates(Kind):
    """A gyroscope on a rate table: the angular rate about each axis is known."""

    name = file = "rates"
    rows = size_in = "turns and rests"
    columns = (("rate_deg_s", "gx", "gy", "gz"),)
    outputs = ("gx", "gy", "gz")
    input_unit = "deg/s"
    perfect_sensor = "a gyroscope without error"
    nominal = " of 1 V/(deg/s)"
    taken = "the means of {} rests and turns"
    default_model = "gyroscope"
    means = known_input = turning = True
    sequential = False
    widest_form = "a linear response to rates and specific forces"
    sensed_in = "deg/s"
    sensed_along = "rate about {} (deg/s)"
    nearest_to = "the axis of rotation"
    drawn_over = ("rate", "rate (deg/s)", "rate_deg_s")
    measurement_caption = "Dots are measured, crosses are the model {}."
    failure_caption = "The residual of the model {} over the rate of the turn."


TURN_MARKS = frozenset(("turn", "resting"))  # columns that a log of turns may lack: they are found in the samples


class Turns(Kind):
    """Turns of a gyroscope between rests: an accelerometer gives the direction of gravity before and after each."""

    name = file = rows = "turns"
    size_in = "samples"
    columns = (("t_s", "turn", "resting", "gx", "gy", "gz", "ax", "ay", "az"),)
    outputs = ("gx", "gy", "gz")
    input_unit = "deg/s"
    default_model = "gyroscope"
    perfect_sensor = "a gyroscope without error"
    nominal = " of 1 V/(deg/s)"
    from_output = turning = overlapping = True
    sensed_in = "deg/s"
    sensed_along = "rate about {} (deg/s)"
    nearest_to = "the axis of rotation"
    note = "Each turn has five values: two of its angle, which gravity shows, and the three rates at rest."
    measurement_caption = "The error of each turn and rest by the model {}: 0 if the model is right."
    failure_caption = "The residual of the model {} over the rate of the turn."


class Motion(Kind):
    """A record of motion. A model is fitted to the parts of the motion in each stretch."""

    name = file = "motion"
    columns = (("t_s", "vx_v", "displacement_m"), ("t_s", "ax", "displacement_m"))
    outputs = ("vx_v", "vy_v")
    digital = ("ax", "ay")
    unit = "V"
    rows = "stretches"
    size_in = "samples"
    note = (
        "The model is fitted to this motion, and its error is that of the fit. The report of the run also compares the "
        "models of the run's sweep with the displacement sensor. Those are not fitted to the motion, so their "
        "error also contains changes since the sweep and the error of the reference."
    )
    fewest_for_form = 15  # stretches, each of which holds a mean and the parts of every line
    moving = True
    measurement_caption = "Output over a few periods without its mean: measured (dots) and model (lines) {}."
    failure_caption = (
        "Mean residual of the model {} over one period of the motion's strongest line, with the noise of the mean."
    )


class Still(Kind):
    """A still record: its model is one of noise."""

    name = file = rows = "still"
    size_in = "samples"
    columns = (("t_s",), ())
    default_model = "still"
    fitted = False


KINDS: Mapping[str, Kind] = MappingProxyType(
    {kind.name: kind for kind in (Poses(), Positions(), Motion(), Still(), Rates(), Turns(), Fields())}
)
FILE_KINDS: Mapping[str, Kind] = MappingProxyType({name: kind for name, kind in KINDS.items() if kind.file == name})
MEANS = tuple(name for name, kind in FILE_KINDS.items() if kind.means)
FITTED_KINDS = tuple(name for name, kind in FILE_KINDS.items() if kind.fitted)
