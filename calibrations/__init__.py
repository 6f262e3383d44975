"""The measurement model of an inertial sensor, and the question which physical effect it is missing.

A library of its own: tables in, frozen results out, no instrument needed.

    table     measured data                      effects/   one physical effect a file
    model     an ordered list of effects         chain      from stage angles to the output
    fit       parameters with uncertainties      noise      white and slow noise of a mean
    compare   where the model fails              diagnose   which effect is missing
    discover  add effects until none is missing  stepwise   the paper's own estimation, beside ours
"""
