"""Results of runs: one file for each procedure that has results, with the name of the procedure.

`noise_floor.py` has `evaluate(measured) -> {name: Result | Missing}` for the procedure "noise-floor", and NAMES, the
names that its results can have. A user's procedure can return such a mapping itself instead.
"""

from rig.results.evaluate import judged
from rig.results.result import Result, documents, returned

__all__ = ["Result", "documents", "judged", "returned"]
