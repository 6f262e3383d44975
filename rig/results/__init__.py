"""Results of runs: a function for each procedure that has results, in the module on its kind of measurement.

`samples.py` has `@evaluates("noise-floor")` and below it a function of what the run measured, which gives a Result, or
the reason why it is Missing, for each name in `rig.bench.result_names`. A user's procedure can return such a mapping
itself instead.
"""

from rig.results.evaluate import judge_results
from rig.results.result import Result, documents, read_returned

__all__ = ["Result", "documents", "judge_results", "read_returned"]
