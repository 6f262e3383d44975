"""The orientations of a sensor in a hand, as text: those that it has, those that it lacks, and the next one.

Three squares show the sphere of directions from above: its upper part, its equator and its lower part. Each place is a
side, an edge or a corner of the sensor that points upward.
"""

from __future__ import annotations

import numpy as np

from calibrations.design.orientations import ORIENTATIONS, covered
from procedures.session import Guidance

TAKEN, LACKING, WANTED = "●", "·", "◎"
LAYERS = ((1, "+z upward"), (0, "z level"), (-1, "-z upward"))
ROWS = (1, 0, -1)  # of y, from above
COLUMNS = (-1, 0, 1)  # of x, from the left


def orientation_map(guidance: Guidance) -> list[str]:
    """The map in five lines, with a legend."""
    marks = _marks(guidance)
    heads = "   ".join(f"{name:<13}" for _, name in LAYERS)
    lines = [f"     {heads}"]
    for y in ROWS:
        squares = ("  ".join(marks.get((x, y, z), " ") for x in COLUMNS) for z, _ in LAYERS)
        lines.append(f"{('+y', '  ', '-y')[1 - y]}   {'   '.join(f'{square:<13}' for square in squares)}".rstrip())
    lines.append("   " + "   ".join(f"{'-x':<5}{'+x':<8}" for _ in LAYERS).rstrip())
    taken_count = sum(mark == TAKEN for mark in marks.values())
    return [*lines, f"{TAKEN} taken ({taken_count} of {len(marks)})   {WANTED} next   {LACKING} not yet"]


def _marks(guidance: Guidance) -> dict[tuple[int, int, int], str]:
    """The mark of each orientation by the signs of its three parts."""
    is_taken = covered(np.array(guidance.taken).reshape(-1, 3))
    marks = {}
    for up, is_covered in zip(ORIENTATIONS, is_taken, strict=True):
        x, y, z = (int(part) for part in np.sign(np.round(up, 6)))
        is_target = guidance.moves and bool(up @ np.array(guidance.up) > 1 - 1e-6)
        marks[x, y, z] = WANTED if is_target else TAKEN if is_covered else LACKING
    return marks
