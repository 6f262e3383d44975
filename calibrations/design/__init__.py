"""Which poses to measure, and what they would tell: information, order, and how far apart rivals would lie."""
