"""The catalogue of physical effects: one effect a file in `signal` and `noise`, found by name.

What the file of an effect imports: `from calibrations.effects import Effect, Parameter, Values`.
"""

from calibrations.effects.effect import HOOKS, OF_ACCELEROMETERS, Constant, Effect, Parameter, Values

__all__ = ["HOOKS", "OF_ACCELEROMETERS", "Constant", "Effect", "Parameter", "Values"]
