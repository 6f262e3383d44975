"""Noise: of the samples of a still sensor, and of the means in a table of poses.

Processes     processes (spectra), spectrum (bands of a record), allan (the Allan deviation of a model)
Samples       kernels (compiled loops), deviations (Allan and others), samples (wild, equal, clipped, hidden)
Record        record (one pass over the samples), channel_spectrum (bands and lines of a channel)
Fit           likelihood (Whittle), fit (a model and its uncertainties), mixtures (all combinations of processes)
Disturbances  patterns (steps, drifts, followed columns), telegraph (two levels), disturbances (all of them)
Search        search (what a model is missing), places (where it fails), answer (doubts and the next experiment)
Results       analysis (`rig noise`), dataset (a still record in the search loop of all kinds of data)

Means         means (white and slow noise as a value), mean_noise (white noise of a mean), table_noise (noise from
              elsewhere), means_fit and means_likelihood (estimation), means_uncertainty (averaged uncertainties)

Values are those of a rate: the output of the sensor. Literature on clocks calls their sum over time the phase.
"""
