"""A look as a document of plain values, and back."""

from __future__ import annotations

from dataclasses import fields
from functools import lru_cache
from sys import intern
from typing import Any

import numpy as np

from calibrations.fleet.look import Look, Score, Stage


def write_look(look: Look) -> dict[str, Any]:
    """Numbers to their last bit."""
    return {
        **_plain(look),
        "scores": [_plain(score) for score in look.scores],
        "stage": _plain(look.stage),
    }


def read_look(document: dict[str, Any]) -> Look:
    """The look that was written."""
    said = dict(document)
    stage = said.pop("stage")
    scores = tuple(Score(**_arrays(score) | {"effect": intern(score["effect"])}) for score in said.pop("scores"))
    names = _one(tuple(tuple(name) for name in said.pop("names")))
    k = len(stage["names"])
    return Look(
        **_arrays(said) | {"outliers": tuple(said["outliers"])},
        names=names,
        scores=scores,
        stage=Stage(
            _one(tuple(tuple(name) for name in stage["names"])),
            np.array(stage["score"], dtype=float),
            np.array(stage["information"], dtype=float).reshape(k, k),
        ),
    )


@lru_cache(maxsize=1000)
def _one(names: tuple[Any, ...]) -> tuple[Any, ...]:
    """The same object for the same names, which all sensors of a batch have."""
    return names


def _plain(value: Any) -> dict[str, Any]:
    each = {field.name: getattr(value, field.name) for field in fields(value)}
    return {name: item.tolist() if isinstance(item, np.ndarray) else item for name, item in each.items()}


def _arrays(document: dict[str, Any]) -> dict[str, Any]:
    return {name: np.array(item, dtype=float) if isinstance(item, list) else item for name, item in document.items()}
