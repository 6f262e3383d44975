"""The thresholds by which effects are named, models are judged and data are set aside, each with its reason.

A number belongs here if another choice would change a verdict. Numbers of a method (grid sizes, rounding) stay with it.

Units: excess is rmse over noise floor; a gain is twice a gain in log-likelihood; a chance is that of noise alone.
FEWEST_... is the least count with which a question can be answered; with fewer the answer is that it is not known.
"""

from __future__ import annotations

# Significance
SIGNIFICANT = 0.003  # chance over a whole search: about one false name in 300 runs with nothing missing
NOTEWORTHY = 0.05  # chance over a whole search: not named, but worth a second measurement
CHECK_SIGNIFICANT = 0.01  # chance for check poses and repeats: one test alone, not a search
INSEPARABLE = 6.0  # gain: odds below 20 to 1 between two explanations; the data cannot separate them
CLEARLY_BETTER = 6.0  # gain beyond the price of parameters: odds of 20 to 1, enough to exchange one effect for another
PATTERN_BETTER = 10.0  # gain beyond the price of parameters: odds of 150 to 1, to prefer a pattern without a cause

# Intervals
COVERAGE = 0.95  # probability of every interval and bound
INTERVAL_STDS = 1.96  # standard deviations: half of such an interval of a normal distribution
COVERAGE_FACTOR = 2.0  # standard uncertainties: expanded uncertainty of a result (JCGM 100, 6.3.3)

# Size of an error
LEAST_NOISE, NO_MORE_THAN_NOISE = 0.93, 1.06  # excess: between them, one effect or none explains all
FEWEST_FOR_PLACES = 36  # poses that can show where in the signal chain something acts
LARGER_NOISE = 1.5  # times the stated noise: less may be effects whose form is nearly right
MATERIAL = 1.15  # excess: below, the residual is as good as noise
MOST_SLOW_NOISE = 2.5  # excess: white and slow noise of a sensor alone leave less
MOST_UNSEEN = 1.5  # excess on unseen stretches of a motion: the right effect leaves more in one of 30 records
MOST_UNEXPLAINED = 1 / 5  # of the excess variance: with more left, the catalogue has not explained the data
MOST_BY_FORM = 1 / 16  # of the excess variance: less may be the form of a named cause, which is approximate
LEAST_SHARE = 0.05  # of the excess variance: a step that explains less may be the wrong form of a strong effect
FORM_PART = 0.1  # of an effect's size: what its form may differ by from the one that acts
REFINEMENT = 0.02  # of the greatest cost of loss: an effect that costs less refines the form of another
NEGLIGIBLE = 0.02  # of a deviation or density: a noise model this near is as good as right

# Search
MOST_EFFECTS = 14  # added in one search: data of one sensor determine no more
MOST_EXCHANGED = 6  # added effects that are tested against each other: more take longer than a person waits
EXCHANGE_ROUNDS = 6  # of exchanges: each raises the likelihood, so that few suffice
CANDIDATES_FOR_A_PLACE = 2  # best candidates that are tried in the place of an effect
NEARLY_AS_GOOD = 0.9  # of the best gain: a candidate with less is not tried in the place of an effect
LIKELY = 0.5  # probability of a candidate: from here on it is worth a sentence, though it is not significant
SAME_SHAPE = 0.5  # of the best gain: a candidate with less has another shape and is no rival

# Patterns without a known cause
PATTERN_CONTAINED = 0.98  # of the squares: a pattern that holds this much of an effect describes the effect's form
MOST_ROWS_STAND_OUT = 1 / 10  # of the rows: more are no outliers but a pattern
FEWEST_LEVELS = 12  # values of a column: with fewer, a step at one of them is no pattern of the column
MOST_UNDER_SLOW_PATTERN = 1 / 5  # of the excess variance: slow noise leaves more of a pattern in time

# Gross outliers
GROSS = 10.0  # times the spread of neighbouring poses: noise alone does not reach this
MOST_GROSS = 1 / 20  # of the poses: more are no accidents
SAME_G = 1e-3  # specific force between two poses: with less they are the same pose, as stages repeat it

# Determination by the data
MOST_UNCERTAIN = 2.0  # variance of a predicted row over that of noise: parameters count for as much as noise
FEWEST_CHECKS = 3  # check poses, and repeats: fewer estimate no noise
NOT_SHOWN = 1e-2  # of a column's length: if less of it is independent of the model, the data cannot show the effect
WRONG_FLOOR = 0.5  # error over the stated noise floor: white noise alone leaves no less, so that the floor is wrong
FEWEST_FOR_FLOOR = 20  # rows: fewer can be so near to a model by chance
FEWEST_VISITS = 4  # of each pose: from there on rows do not show what a model predicts between the poses
FEWEST_FREE_ROWS = 2  # rows beyond the parameters of the widest form: fewer do not estimate their scatter

# Next experiment
CERTAIN_PROBABILITY = 0.95  # of separating two explanations: an experiment with less is not worth its time
NAMED_GAIN = 20.0  # gain of two parameters with a chance of SIGNIFICANT in a search worth 60 trials
LONGEST_RECORD_S = 7 * 86400.0  # of a proposed record: a week at most

# Noise of means
FEWEST_FOR_SLOW = 20  # rows: with fewer, slow noise cannot be separated from white noise
NO_SCATTER = 1e-3  # of the usual scatter of samples: less is rounding, and the mean has the usual scatter

# Places where a model fails
STANDS_OUT = 1.1  # times the excess of the whole axis: a place with less is no worse than the rest
ONE_SIDED = 0.5  # of the rms residual of the axis: a mean residual beyond lies to one side

# Noise of a still record
PATTERN_AMPLITUDE = 14.0  # gain: the amplitude of a pattern is chance in one of 5000 records
PATTERN_CERTAIN = 60.0  # gain of a step in noise that jumps: such noise has steps of its own
IDENTIFIED = 3.84  # gain at the end of a 95 % interval; an absent process reaches it in one of 40 channels
AT_LONGEST_TIME = 0.9  # of the longest time constant: such a process has the form of the slower one that it contains
FEWEST_PERIODS = 6  # in the record: a slower sinusoid cannot be separated from a drift
LEAST_WHITE = 1e-3  # of the density below a corner: less white noise does not change the fit of a low-pass
SLOWEST_FILTER_HZ = 0.1  # corner of an output filter: with a lower one the sensor could measure no motion
LEAST_GAINS = {  # gain, by process
    "quantisation-noise": 12.0,  # one record in 4000: it changes the white noise that it is taken for most
    "gauss-markov-noise": 22.0,  # other processes together nearly have its shape
}
LEVELS_BETTER = 14.0  # gain beyond the price of the path: chance in one of 1000 records
JUMPS_PER_LEVEL = 2  # at least, and as many stays at each level: it is reached again, which a step does not do
MOST_BESIDE_LEVELS = 0.02  # of the slow variance: five levels leave 0.04 or more of noise of any level
MANY_JUMPS = 10  # to each level: fewer random steps, put into five levels, can leave as little
MOST_LEVELS = 5  # of random telegraph noise: more are noise of any level
MOST_PATTERNS = 4  # of a channel: a line, a curvature and a branch over temperature, and a step; more are noise
FALSE_LINE = 1e-3  # chance of a line over all frequencies of a record
FALSE_MINIMUM = 0.05  # chance of a minimum over all pairs of averaging times of a level Allan deviation
MOST_FAST_LINES = 8  # of a channel: a disturbance and its first harmonics
FEWEST_FAST_STRETCHES = 3  # periodograms: the mean of fewer is too uncertain for a fast spectrum
FEWEST_SAMPLES = 64  # of a record, or correlation times of its filter: fewer bands determine no process
FEWEST_MEANS = 120  # means: with fewer a type of noise is less than 2.7 standard errors from the next
FEWEST_LEVEL_ORDINATES = 8  # of a part: with fewer its noise level is known to no better than a third
FEWEST_ORDINATES = 16  # of a logged column: with fewer its scatter cannot be separated from its level
FILTER_PERIODS = 4.0  # of a low-pass: at longer times noise averages as if there were none
SPOILT_BY = 2.0  # standard uncertainties: a disturbance that changes a coefficient by less does not spoil it

# Samples of a still record
LEAST_DITHER = 0.5  # of a converter's step: with less noise, rounding is no longer independent of it
FEWEST_FOR_SCALE = 256  # samples: the ninth decile of fewer is no scale of the noise
WILD_SAMPLE = 12.0  # standard deviations: normal noise has no such sample in a lifetime, Laplacian noise one in 10^7
MOST_WILD = 1e-3  # of the samples: more are how this noise is distributed
MOST_PLACEHOLDERS = 0.05  # of the samples at exactly one value far away: placeholders for missing readings
SHORTEST_STUCK = 32  # equal samples: coarse steps make shorter runs
STUCK_BEYOND_CHANCE = 4.0  # times the longest run that chance makes
CLIPPED = 0.002  # of the samples at the highest or lowest value: noise has few there
CLIPPED_BEYOND_USUAL = 10.0  # times the share of any value: with coarse steps many samples are equal

# Approach to a steady state
FEWEST_APPROACH_VALUES = 8  # values: two parameters an exponential, and as many to test it
FEWEST_STEADY_VALUES = 20  # values: with fewer a drift looks like slow noise
SPARE_VALUES = 4  # values beyond the parameters that another exponential needs
EXPONENTIAL_GAIN = 24.0  # gain: a random walk seldom makes as much for another exponential
MOST_EXPONENTIALS = 2  # the board's hours and the package's minutes: a third is never determined
LEAST_TAU_RATIO = 3.0  # of two time constants: nearer ones cannot be separated under noise
LIKELY_WALK = 0.5  # probability of a random walk: beyond, there is no steady state
WALK_RATIO = 2.0  # slow over fast noise: beyond, and slower than half of the record, noise is a random walk
MOST_KNOWN_WIDTH = 0.25  # of the whole change: half the width of a final value that counts as known
MOST_SURPRISE = 3.0  # mean squared innovation over its variance: beyond, the drift is no approach
LONGEST_MOVE_S = 120.0  # between poses: a longer time without data is a gap
LONGEST_HOLD_GAP = 2.0  # samples within a hold: a longer time without data is a gap
REACHED_K = 1.0  # from the set point: an oven that is further away is still heating

# Stability and control
FEWEST_FOR_DRIFT = 3  # values: fewer cannot separate a drift from scatter
SHORTEST_FOR_DRIFT_DAYS = 30.0  # between the first and the last value: no rate a year from a shorter time
HORIZON_DAYS = 3653  # ten years: no forecast of a drift beyond
FEWEST_TURNS = 2  # of a magnetometer: one turn does not show how well turns agree
LIMIT_SIGMAS = 3.0  # of an individual value: a false alarm in 370 runs (Shewhart)
EWMA_LIMIT = 2.962  # of a weighted mean with the weight 0.2: a false alarm in 500 runs (Lucas and Saccucci)
BASELINE_RUNS = 20  # that set the limits: with fewer, half of the charts signal within 80 runs
FEWEST_RUNS = 2  # of a chart: one run has no moving range

# Sensors of a fleet
FEWEST_SENSORS = 4  # that make a batch: a median and a spread of fewer mean nothing
FEWEST_SIBLINGS = 3  # values: the posterior of a spread needs as many
FEWEST_SENSORS_PER_RIG = 3  # beyond those that a rig's parameters explain
MOST_SCORE_LENGTH = 2.0  # times the median score: so that one sensor does not decide for its batch
LEAST_SHARED_GAIN = 2.0  # fall of the sum of squares for each parameter (Mallows' C_p): errors on new data fall
LEAST_GAINING_SHARE = 0.5  # of the sensors: an effect of the batch is one of most of them
POSSIBLY_SLOW = 0.05  # chance where all slow noise is taken as an effect: below, it is compared with slow noise
FALSE_OUTLIER = 0.01  # chance of setting any value of a batch apart where all are alike
MOST_USUAL = 3.0  # robust standard deviations from the median: values beyond are tested without each other
FAR_SENSOR = 5.0  # robust standard deviations from batch and rig: such a sensor is not used for the rig

# Outputs that cannot be those of the sensor, mounted and wired as stated
EXCITED_G = 0.1  # rms of a specific force about its mean: below, offsets of the stages hide a response
FEWEST_RESPONSE_ROWS = 12  # three times the parameters of a response
FOLLOWS_GRAVITY = 0.5  # of an output's variance: sensors with 5 % nonlinearity keep 0.99
EXPLAINED_BY_GEOMETRY = 0.9  # of an output's variance: the geometry is right, and effects remain
FAR_BETTER_GEOMETRY = 0.1  # of the variance that the stated geometry leaves: another geometry with less is right
WEAK_RESPONSE = 1e-3  # chance in an F test: a response as weak as noise, but present
FAR_LESS_VARIATION = 0.02  # of another output's: axes of one sensor have scale factors within 5 %
STUCK_ROWS = 0.2  # of the rows at one value, where gravity changes: noise has no such value
STUCK_CHANGE = 0.1  # of the expected change: a healthy output changes as expected
LEAST_OTHER_SIDE = 0.1  # of the stuck rows: a saturated output has none on the other side
LEAST_ASIDE = 0.1  # of the output's range, off the stuck value: a dead zone is a hundredth of that
LEAST_STAGE_SCALE = 3e-3  # of an angle: 1 deg in a turn, which no stage is off by
LEAST_STAGE_ZERO_DEG = 1.0  # zeros of stages, and edges of sensors, are set to tenths
LEAST_RESPONSE_CHANGE = 0.05  # of the slopes, in mid-run: 3 deg; sensors drift by thousandths
UNTOUCHED_BY_READINGS = 1e-5  # of an output's variance: with less left no other reading is searched for
LARGEST_MISFIT = 0.06  # of an output's variation: effects of a sensor leave less of it
MUCH_MORE_THAN_NOISE = 3.0  # times the noise floor, without any pattern: the floor is wrong
FEWEST_EQUAL = 3  # rows with exactly one value, where nearly all others differ
EQUAL_SHARE = 0.02  # of the rows
TIMES_NEXT = 2  # as often as any other value
DISTINCT_SHARE = 0.8  # of the other rows: readings of a fine converter hardly ever agree
FAR_FROM_OTHERS = 10.0  # robust standard deviations: no temperature of one run
VISIBLE_STEP = 3.0  # standard deviations by rounding over the noise floor
UNLIKE_AXES = 3.0  # ratio of the scale factors of two axes: axes of one sensor are alike
V_PER_G = (5e-3, 20.0)  # of accelerometers with an analogue output
OWN_UNIT = (0.5, 2.0)  # scale factor of outputs in the unit of the sensed quantity
RATE_AGREES = 0.02  # between the times of the samples and the stated rate
TURNED_DEG = 20.0  # mount or zero: marks are within some degrees, so that this is another one
LEFT_WITHIN_GROUPS = 0.05  # of the variance: two halves of Gaussian noise leave 0.36, of a sine 0.19
GROUPS_APART = 10.0  # noise floors: effects and odd rows are less apart, or have a pattern
SMALLER_GROUP = 0.1  # of the rows: a smaller group is outliers
PATTERNED = 0.5  # of the way from chance to all neighbours in one group: more is a pattern of pose, time or direction

# Orientations
UPRIGHT_COSINE = 0.94  # of an edge and the vertical: within 20 deg the edge is upright
LEAST_OTHER_AXIS = 0.01  # of the mean square rate, about another axis: 6 deg off it
LEAST_MAIN_SLOPE = 0.8  # of all outputs' slopes over the rate, by the edge that was turned about
MOST_WORSE_COVERED = 10.0  # times the uncertainty of as many orientations on all sides: more is not determined
LONGEST_GAP_DEG = 45.0  # between points of an error table: an eccentricity cannot be interpolated beyond
POINT_REACH_DEG = 1.0  # into such a gap: so far the error of the nearest point holds
SHORTEST_APPROACH_DEG = 0.5  # of a stage: a shorter move does not take up its backlash

# Motion
LONGEST_STEP = 1.5  # usual steps of time: more is a lost sample, and a new record
MOST_UNEVEN = 0.75  # of a step: rounded times are off by less, a lost sample by more
SHORTEST_MOTION_S = 2.0  # of a record: four periods of the slowest procedure
FEWEST_MOTION_PERIODS = 4  # in the record: a slower line is drift, and the shortest record holds as many
PROMINENT = 8.0  # times log(lines) the density around it: noise alone shows no such line
HIGHEST_MOTION_HZ = 30.0  # of a line: above it, and above HIGHEST_MOTION, is the hum of the probe
HIGHEST_MOTION = 1.5  # times the frequency of the strongest line
MOST_SINES = 8  # of a motion: a driven line and its first harmonics
LEAST_LINE = 6.0  # times the median density: a line beyond is not of this noise
LEAST_LINE_WEIGHT = 1.0  # noise of a row: a line that is weaker in every stretch shows nothing
FEWEST_MOTION_STRETCHES = 6  # with fewer, slow noise of a motion is not estimated

# Numbers that are possible in the unit that a file gives them
HIGHEST_V = 50.0  # analog outputs end at the supply, 36 V at most
HOTTEST_C = 200.0  # parts are specified to 125 degC, some to 175
COLDEST_C = -100.0  # parts are specified from -55 degC
LONGEST_M = 0.5  # a piezo stage travels 0.1 mm, a shaker a few centimetres
LARGEST_ALPHA_DEG = 360.0  # an inclination lies within one turn
LARGEST_BETA_DEG = 3600.0  # ten turns: cables allow fewer
FEWEST_ANGLES = 6  # distinct values: all lie on whole arc minutes by chance with odds of one in millions
STILL_G = (0.3, 3.0)  # a sensor at rest shows 1 g, its bias and scale factor within reason
SHOWN_OF_RATE = (0.3, 3.0)  # of an output to its rate, its scale factor within reason: rad/s are off by 57
EARTH_UT = (20.0, 70.0)  # on the ground 22 to 67 uT (World Magnetic Model)
MOST_MAGNITUDE_SPREAD = 0.3  # interquartile range over median: scale factors of cheap sensors differ by tenths
LEAST_DIRECTION_SHARE = 0.01  # mean square of directions along their weakest axis; 1/3 over the whole sphere

# Samples in a table of means
FEWEST_POSITIONS = 4  # the smallest model has as many parameters
SHORTEST_STILL_S = 1.0  # of a still interval: a hand rests for less between two moves
MOST_STILL_NOISE = 3.0  # quiet standard deviations: a window with less is still
LEAST_FIELD_CHANGE = 0.005  # of the field, rms: sensors of the earth's field leave less of an ellipsoid
MOST_FIELD_EXCESS = 3.0  # excess: with more, the field differs from position to position
FEWEST_TURNS_OF_A_GYROSCOPE = 6  # two values of each turn: nine parameters, and three values that check them
SMALLEST_TURN_DEG = 20.0  # between rests, in the middle of all turns: smaller ones tell little of a scale factor
SHORTEST_CLIPPED = 4  # equal successive samples at the extreme of a turn: the end of an output's range
CLIPPED_STEPS = 8.0  # of the output, next to such samples: beside the peak of a turn there are four
LEAST_CLIPPED_NOISE = 20.0  # noise at rest: smaller outputs are equal by coarse steps
LEAST_OF_WHOLE_TURN = 0.7  # of the largest turn by hand: from face to face it is half a turn at most
MOST_TURN_DEVIATION = 0.03  # from the other turns about one axis: a straight edge repeats a whole turn to 1 deg in 360
LEAST_TURNED_SPREAD = 3.0  # noise of a sample: gravity on several sides spreads hundreds of times more
LEAST_HANDLED_SPREAD = 10.0  # quiet standard deviations: a hand exceeds it, a log at rest never does
FEWEST_ROWS_AT_REST = 50  # in succession: more rows are samples of one pose, not repetitions
FASTEST_MEANS_S = 0.5  # between rows: no stage moves and settles in less
JITTER_DEG = 0.05  # of an encoder at rest, peak to peak; stages resolve 5 arcmin
SHORTEST_DWELL_SHARE = 0.25  # of the typical dwell: a shorter one is a stage that stops on its way
LONGEST_PAUSE = 20.0  # usual distances of samples: beyond, the logger paused between two dwells
SHORTEST_PAUSE_S = 0.2  # a shorter pause is a late sample
MOST_UNCERTAIN_INFLATION = 0.1  # relative standard error: an inflation known worse is left out
FEWEST_SECTION_SAMPLES = 20  # mean number in a section: with fewer, the rows are not samples
LEAST_TURN_SHARE = 0.2  # of the largest distance from rest: from here on, a section is a turn
LEAST_TURN_NOISE = 10.0  # noise of a sample at rest: a turn by hand is much larger
