"""The noise of a still sensor: its processes, and signals that are not noise.

Spectra     lines (sinusoids), deviations (Allan and others; `kernels`)
Record      samples (wild, equal, clipped, hidden), record (one pass over the samples)
Fit         likelihood (Whittle), fit (a model and its uncertainties), mixtures (all combinations of processes)
Search      patterns (what is no process), search (what a model is missing), comparison (where it fails), doubts (what
            the record cannot decide, and the experiment that does)
Results     analysis (`rig noise`), dataset (a still record in the search loop of all kinds of data)

Values are those of a rate: the output of the sensor. Literature on clocks calls their sum over time the phase.
"""
