"""Models: ordered lists of effects, their parameters, their files, and the signal chain that computes them."""

from calibrations.model.model import Estimate, Model, Term

__all__ = ["Estimate", "Model", "Term"]
