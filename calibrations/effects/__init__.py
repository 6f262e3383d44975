"""The catalogue: one physical effect a file, found by name. See `calibrations.effect` for their form."""
