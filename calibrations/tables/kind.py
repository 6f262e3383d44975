"""What may differ between kinds of measured data: facts and words, the same members for every kind.

How a model is fitted to rows of a kind is in `calibrations.problem`; how they are drawn, in `presentation.charts`.
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

    known_input: bool = False  # whether each row has a known specific force or rate: the residual is in the output
    same_pose: tuple[str, ...] = ()  # columns whose values make two rows the same pose
    sequential: bool = True  # whether rows without times are taken as one second apart
