"""Which poses to measure: their information, their order, and how well they separate rival effects."""
