"""What a run's measurements come to: one file for each procedure that has results, found by its name.

`noise_floor.py` holds `evaluate(measured) -> {name: Result | Missing}` for the procedure "noise-floor", and the NAMES
that its results can have. A procedure of the user's own may return its results instead, as such a mapping.
"""

from rig.results.evaluate import judged
from rig.results.result import Result, documents, returned

__all__ = ["Result", "documents", "judged", "returned"]
