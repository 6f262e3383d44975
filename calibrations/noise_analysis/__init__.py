"""Noise of a still sensor: how it averages, its spectrum, and the processes that it is made of.

    octaves      Allan deviations at octave times: one pass over blocks, constant memory
    exact        the same at any time, with every overlap, of an array at hand
    asked_times  the Allan deviation at times that are asked for
    freedom      degrees of freedom of a deviation, and its interval
    noise_type   the power of frequency that a spectrum follows, from neighbouring means
    minimum      whether a deviation has a minimum, or only chance makes one
    outliers     single samples that are far from their neighbours
    stuck        a stretch of samples that are all the same
    hidden       noise below the steps of a converter
    oddities     all three in words
    reduction    all that is kept of a record, in one pass
    decimated    a record of any length as at most 2^17 means
    welch        the spectrum of what is faster than these
    bands        both as averages over narrow bands, each a chi-square variable
    processes    the spectra of white noise, flicker, random walk ...
    expected     the Allan variance that a spectrum makes
    whittle      their coefficients by maximum likelihood
    identify     which of them the data shows, and bounds on the others
    lines        sinusoids
    analysis     all of it in one pass

Values are those of a rate: the sensor's output. Their sum over time is what the literature on clocks calls phase.
"""
