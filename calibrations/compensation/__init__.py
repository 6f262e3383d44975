"""What a sensor's user runs: a calibrated model turned round, from outputs to specific force, as source text.

graph, operations   arithmetic as a graph: what a product computes, and nothing else
traced, forward     a model's effects as such a graph, from specific force to output
interval, bound     what the graph can come to over a range, and how fast the way back closes in
inverse             the way back: a fixed number of steps with a proven bound
program             it as straight lines of code, and their count
cost                what is left out costs, and what the parameters' uncertainties do
c99, python, json   writers
"""
