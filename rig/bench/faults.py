"""What is wrong with a bench file, in words: the key, and the nearest one where it is not known."""

from __future__ import annotations

import dataclasses
from typing import Any

from pydantic import BaseModel, ValidationError

from drivers.links.faults import Fault
from procedures.session import Limits
from rig.bench.parts import Certificate, Displacement, Folders, Instrument, Lab, Sensor, Uncertainty
from rig.nearest import did_you_mean

UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")


def told(error: ValidationError, model: type[BaseModel]) -> str:
    """The first fault, with the key's place in the file; a misspelt key comes before the one that it was meant for."""
    faults = error.errors()
    fault = min(faults, key=lambda fault: fault["type"] not in UNKNOWN)
    where = [str(part) for part in fault["loc"] if "[" not in str(part)]  # a type of several is no key
    if where[0] == "lab":  # a URL may hold a password
        fault = {**fault, "input": "..."}
    return f"key {'.'.join(where)}: {fault_of(fault, _keys(model, where[:-1]))}"


def fault_of(fault: Any, keys: list[str]) -> str:
    """One fault of a value; `keys` are those known at its place."""
    if fault["type"] in UNKNOWN:
        return f"no such key.{did_you_mean(str(fault['loc'][-1]), keys)}"
    if fault["type"] == "missing":
        return "is missing; `rig check --example` prints a bench file that has all"
    why = fault["msg"].removeprefix("Value error, ")  # what a part of ours says itself
    return f"{why}, is {fault['input']!r}"


def _keys(model: Any, where: list[str]) -> list[str]:
    """The keys that are known at a place of the file."""
    own = {"limits": Limits, "d63": Displacement, "uncertainty": Uncertainty, "lab": Lab}
    parts = {"instruments": Instrument, "sensor": Sensor, "folders": Folders, **own}
    part = parts.get(where[0], model) if where else model
    if where and (where[0] == "certificates" or where[-1] == "certificate"):
        part = Certificate
    if "faults" in where:
        part = Fault
    if dataclasses.is_dataclass(part):
        return [field.name for field in dataclasses.fields(part)]
    return list(part.model_fields)
