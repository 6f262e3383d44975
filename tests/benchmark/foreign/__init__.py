"""A second independent simulator: sensors with hidden causes whose forms are those of no other simulator here.

    bench       poses, time, room, supply, and where the stages truly stand
    causes      each cause of the catalogue in two physical forms, and mechanisms outside of the catalogue
    sensor      the chain from the true force to the logged means
    __main__    writes sets and their truth, to be scored by `tests.benchmark.hidden --folder`

Nothing is imported from the catalogue of effects, the simulated world, or the other simulators.
"""
