"""The world that the simulated instruments measure: mechanics, heat, supply, converter, noise.

It shares no formula, no parameter and no name with the measurement model: what it does to a
voltage follows from springs, gaps, friction and heat, so that a diagnosis has something to find.
"""
