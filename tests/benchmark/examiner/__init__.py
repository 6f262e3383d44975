"""A third independent simulator: dual-axis accelerometers on varied benches, with varied averaging and hidden causes.

    layouts     ten sequences of poses, and gravity in the frame of the sensor
    room        clock, temperature, supply voltage and slow noise
    averaging   how many samples a mean has, which filter they passed, what the file says about it; vibration
    record      one drawn bench with its sensor: what a cause may look at
    cause       the type of a cause, and the constants that are drawn for it
    stages      forms of causes: alignment of the sensor, base and stages
    responses   forms of causes: response of the sensing element to the force
    loops       forms of causes: hysteresis by Bouc-Wen, Prandtl-Ishlinskii and Preisach
    slow        forms of causes: temperature and time
    electronics forms of causes: supply, vibration, converter
    unknown     mechanisms outside of the catalogue
    chain       from the stage angles to the output voltage, and the size of a cause
    imitation   which textbook forms take up a cause
    remarks     what the truth says about the difficulty of a set
    sets        one set: the table as CSV text and its truth
    __main__    writes sets and their truth, to be scored by `tests.benchmark.hidden --folder`

Nothing is imported from the catalogue of effects, the simulated world, or the other simulators.
"""
