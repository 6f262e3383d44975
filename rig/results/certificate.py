"""The results of a certificate: a parameter of any shipped effect, by the name that its limits have in a bench file."""

from __future__ import annotations

from calibrations.certificates.terms import names
from calibrations.effect import catalogue

NAMES = tuple(name for effect in catalogue().values() for name in names(effect))
