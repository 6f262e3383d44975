"""Discovery beside its peers, on data whose causes are mechanisms and none of the catalogue's formulas.

`python -m tests.benchmark.discovery` prints the table of demands. Three generators make the data: the simulated world
(tests/hidden/rigs.py), sweeps made sample by sample (tests/hidden/sampled.py), and the rigs of this folder, which have
other layouts, other mechanisms and other noise. `cases.case(name, strength, seed)` gives any set again.
"""
