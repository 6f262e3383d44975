"""The loop of model and measurement for the noise of a still sensor.

    record     a still record, reduced to what a likelihood needs: means, fast spectra by time, Allan deviations
    bands      its spectrum without the lines that a model takes off it
    fit        a noise model's coefficients by Whittle's likelihood, with uncertainties
    allan      the Allan deviation that a model expects
    mixtures   every mixture of noise effects beside a model, and which of them is missed least
    patterns   what is no noise process: a step, a drift, a level that changes, a bump of the spectrum, a line
    compare    where a model fails: averaging times and frequencies
    answer     what a search comes to: verdict, alternatives or reason, next experiment
    filtered   white noise behind a low-pass that nobody stated
    diagnose   which process it is missing
    discover   the model with all that it was missing

A noise model is a model as any other; its effects act on the spectrum of a record (`calibrations.effect`), and each
channel of a sensor has coefficients of its own.
"""
