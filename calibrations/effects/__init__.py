"""The catalogue of physical effects: one effect a file in `signal` and `noise`, found by name.

What the file of an effect imports: `from calibrations.effects import Effect, Parameter, Values`.
"""

from calibrations.effects.effect import ACCELEROMETER_KINDS, HOOKS, Constant, Effect, Parameter, Values

__all__ = ["ACCELEROMETER_KINDS", "HOOKS", "Constant", "Effect", "Parameter", "Values"]
