"""Charts of results by topic: pure functions from a result to a `Chart` or a `Panel`."""
