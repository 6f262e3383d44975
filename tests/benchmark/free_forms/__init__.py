"""A prototype of discovery by free forms: structure first, names second (docs/decisions, "Structure before names").

A peer of the shipped search, for benchmarks only. It finds the places of the signal chain that act, with free curves
and catalogue forms as random effects under restricted maximum likelihood, and then names the cause in each place.

    measurement, adapter   the data; the adapter alone imports the project
    bases, chain, places   bases of curves, the signal chain, the candidates at each place
    reml, search           sizes by restricted maximum likelihood, and the selection of components
    naming, geometry       causes from curves, and from linear parts
    held_out, discovery    error on unseen poses, and the whole answer
"""
