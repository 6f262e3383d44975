"""Discovery: candidates, their significance on rows not fitted, the search for missing effects, and patterns."""
