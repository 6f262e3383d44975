"""Compensation: a calibrated model inverted, from outputs to specific force, as source text for a user's product.

graph               arithmetic as a graph
trace, forward      a model's effects as a graph, from specific force to output
bound               interval arithmetic over the graph, and the proved contraction of the inverse
inverse             the inverse: a fixed number of steps with a proved bound
program             the inverse as lines of code, and its operations
cost                errors due to effects left out, and uncertainty due to the parameters
sources, document    writers
"""
