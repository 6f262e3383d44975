"""The results of a certificate: a parameter of any shipped effect, by the name that its limits have in a bench file."""

from __future__ import annotations

from calibrations.effects.catalogue import catalogue
from calibrations.presentation.certificate.terms import names

NAMES = tuple(name for effect in catalogue().values() for name in names(effect))
