"""What may differ between kinds of measured data: facts and words, the same members for every kind.

The residual of each kind is in `calibrations.fitting.problem`, its charts are in `calibrations.presentation.charts`.
"""

from __future__ import annotations


class Kind:
    """One kind of data. Members have the value that most kinds share; a subclass gives its own."""

    name: str  # as effects and models are defined for it
    file: str  # kind of data file that holds it
    columns: tuple[tuple[str, ...], ...]  # sets of columns, of which one must be complete
    outputs: tuple[str, ...] = ()  # columns of the outputs, in the order of the axes x, y, z
    unit: str = ""  # of the outputs; "" where each table gives its own
    input_unit: str = "g"  # of the sensed quantity
    default_model: str = "linear"

    rows: str  # what its rows are called
    size_in: str  # what the size of a table is counted in

    symbol: str = "a"  # of the sensed quantity
    sensed_in: str = "g"  # what its magnitude is given in
    sensed_along: str = "specific force along {} (g)"  # its component along an axis
    nearest_to: str = "gravity"  # the direction by which rows are told apart
    drawn_over: tuple[str, str, str] | None = None  # name, label and column that charts draw its rows over
    measurement_caption: str  # of the picture of measurement beside {model}
    failure_caption: str  # of the picture of where {model} fails
    taken: str = "the means of {} still positions"  # the rows that a log of raw samples gave, by their number
    perfect_sensor: str = "the linear model"  # what the picture of an effect is compared with
    nominal: str = " of 1 V/g"  # the sensor in that picture
    widest_form: str = ""  # whose residual is the noise where the rows give none
    note: str = ""  # what else judges such data, in words

    fitted: bool = True  # whether models are fitted to its rows by least squares
    means: bool = False  # whether a row is the mean of samples in one orientation or at one rate
    budget: bool = False  # whether a report draws up an uncertainty budget
    known_input: bool = False  # whether each row has a known specific force or rate: the residual is in the output
    stage_angles: bool = False  # whether stages gave each row its orientation
    moving: bool = False  # whether the sensor moves: its output filter matters, and rows are stretches that repeat
    turning: bool = False  # whether the sensor turns at a constant rate, which is what it senses
    magnitude: bool = False  # whether only the magnitude of the sensed quantity is known
    field: bool = False  # whether that is a field, whose strength is a parameter
    same_pose: tuple[str, ...] = ()  # columns whose values make two rows the same pose
    sequential: bool = True  # whether rows without times are taken as one second apart
