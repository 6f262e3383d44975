"""Finding what a model misses: candidates, their significance on poses not seen, and what no effect explains."""
