"""The thresholds by which effects are named, models are judged and data are set aside, each with its reason.

A number belongs here if another choice would change a verdict. Numbers of a method (grid sizes, rounding) stay with it.

Units: excess is rmse over noise floor; a gain is twice a gain in log-likelihood; a chance is that of noise alone.
"""

from __future__ import annotations

# Significance
SIGNIFICANT = 0.003  # chance over a whole search: about one false name in 300 runs with nothing missing
NOTEWORTHY = 0.05  # chance over a whole search: not named, but worth a second measurement
CHECK_SIGNIFICANT = 0.01  # chance for check poses and repeats: one test alone, not a search
INSEPARABLE = 6.0  # gain: odds below 20 to 1 between two explanations; the data cannot tell them apart
CLEARLY_BETTER = 6.0  # gain beyond the price of parameters: odds of 20 to 1, enough to exchange one effect for another
PATTERN_BETTER = 10.0  # gain beyond the price of parameters: odds of 150 to 1, to prefer a pattern without a cause

# Size of an error
MATERIAL = 1.15  # excess: below, the residual is as good as noise
MOST_SLOW_NOISE = 2.5  # excess: white and slow noise of a sensor alone leave less
MOST_UNEXPLAINED = 1 / 5  # of the excess variance: with more left, the catalogue has not explained the data
MOST_BY_FORM = 1 / 16  # of the excess variance: less may be the form of a named cause, which is approximate
LEAST_SHARE = 0.05  # of the excess variance: a step that explains less may be the wrong form of a strong effect
REFINEMENT = 0.02  # of the greatest cost of loss: an effect that costs less refines the form of another
NEGLIGIBLE = 0.02  # of a deviation or density: a noise model this near is as good as right

# Search
MOST_EFFECTS = 14  # added in one search: data of one sensor determine no more
MOST_EXCHANGED = 6  # added effects that are tested against each other: more take longer than a person waits
EXCHANGE_ROUNDS = 6  # of exchanges: each raises the likelihood, so that few suffice
CANDIDATES_FOR_A_STEP = 3  # best candidates that are refitted for the next step
CANDIDATES_FOR_A_PLACE = 2  # best candidates that are tried in the place of an effect
NEARLY_AS_GOOD = 0.9  # of the best gain: a candidate with less is not tried in the place of an effect
SAME_SHAPE = 0.5  # of the best gain: a candidate with less has another shape and is no rival

# Patterns without a known cause
PATTERN_CONTAINED = 0.98  # of the squares: a pattern that holds this much of an effect describes the effect's form
MOST_ROWS_STAND_OUT = 1 / 10  # of the rows: more are no outliers but a pattern
MOST_UNDER_SLOW_PATTERN = 1 / 5  # of the excess variance: slow noise leaves more of a pattern in time

# Gross outliers
GROSS = 10.0  # times the spread of neighbouring poses: noise alone does not reach this
MOST_GROSS = 1 / 20  # of the poses: more are no accidents

# Determination by the data
MOST_UNCERTAIN = 2.0  # variance of a predicted row over that of noise: parameters count for as much as noise
FEWEST_CHECKS = 3  # check poses, and repeats: fewer estimate no noise

# Places where a model fails
STANDS_OUT = 1.1  # times the excess of the whole axis: a place with less is no worse than the rest
ONE_SIDED = 0.5  # of the rms residual of the axis: a mean residual beyond lies to one side

# Noise of a still record
PATTERN_AMPLITUDE = 14.0  # gain: the amplitude of a pattern is chance in one of 5000 records
PATTERN_CERTAIN = 60.0  # gain: noise that jumps has steps of its own, so that a step beside it needs far more
IDENTIFIED = 3.84  # gain: an absent process, whose power is zero half of the time, reaches it in one of 40 channels
AT_LONGEST_TIME = 0.9  # of the longest time constant: such a process has the form of the slower one that it contains
FEWEST_PERIODS = 6  # in the record: a slower sinusoid cannot be separated from a drift
LEAST_WHITE = 1e-3  # of the density below a corner: less white noise does not change the fit of a low-pass
SLOWEST_FILTER_HZ = 0.1  # corner of an output filter: with a lower one the sensor could measure no motion
LEAST_GAINS = {  # gain, by process
    "quantisation-noise": 12.0,  # one record in 4000: it changes the white noise that it is taken for most
    "gauss-markov-noise": 22.0,  # other processes together nearly have its shape
}
TWO_LEVELS_BETTER = 14.0  # gain beyond the price of the path: chance in one of 1000 records
FEWEST_JUMPS = 4  # between two levels: each is reached again, which a step does not do
FALSE_LINE = 1e-3  # chance of a line over all frequencies of a record
FALSE_MINIMUM = 0.05  # chance of a minimum over all pairs of averaging times of a level Allan deviation
SPOILT_BY = 2.0  # standard uncertainties: a disturbance that changes a coefficient by less does not spoil it

# Samples of a still record
WILD_SAMPLE = 12.0  # standard deviations: normal noise has no such sample in a lifetime, Laplacian noise one in 10^7
MOST_WILD = 1e-3  # of the samples: more are how this noise is distributed
SHORTEST_STUCK = 32  # equal samples: coarse steps make shorter runs
STUCK_BEYOND_CHANCE = 4.0  # times the longest run that chance makes
CLIPPED = 0.002  # of the samples at the highest or lowest value: noise has few there
CLIPPED_BEYOND_USUAL = 10.0  # times the share of any value: with coarse steps many samples are equal
