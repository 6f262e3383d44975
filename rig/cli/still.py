"""The analysis commands on still records: what they print, and how they end."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from calibrations.still.compare import Comparison, compare
from calibrations.still.diagnose import diagnose
from calibrations.still.discover import add, discover
from calibrations.still.documents import (
    comparison_document,
    diagnosis_document,
    discovery_document,
    fit_document,
)
from calibrations.still.fit import fit
from rig.analysis.asked_still import AskedStill, asked_still
from rig.analysis.request import Request
from rig.cli.asked import require_place, write_model
from rig.cli.output import emit, note
from rig.cli.still_words import added, compared, diagnosed, discovered, fitted
from rig.planning.foresight import with_noise_next


def of_still(request: Request, out: Path | None = None) -> AskedStill | None:
    """What a command was asked of a still record; None where the data are none.

    Raises what `asked_still` raises; OutputError where `out` cannot be written, before anything is computed.
    """
    require_place(request, out)
    return asked_still(request, note)


def told_compare(asked: AskedStill, request: Request, check: bool, as_json: bool) -> int:
    """`rig compare`."""
    result: Comparison = compare(asked.still, asked.model)
    name = request.model or asked.model.name
    _emit(as_json, lambda: comparison_document(result, name), lambda: compared(result, name, request.data))
    return int(check and not result.adequate)


def told_fit(asked: AskedStill, out: Path | None, check: bool, as_json: bool) -> int:
    """`rig fit`."""
    found = fit(asked.model, asked.still)
    if out is not None:
        write_model(found, asked.model, out)
    written = str(out) if out else None
    _emit(as_json, lambda: fit_document(found, written), lambda: fitted(found, written))
    return int(check and not compare(asked.still, found.model).adequate)


def told_diagnose(asked: AskedStill, request: Request, check: bool, as_json: bool) -> int:
    """`rig diagnose`."""
    result = with_noise_next(diagnose(asked.still, asked.model, asked.effects), request.bench_file)
    name = request.model or asked.model.name
    _emit(
        as_json,
        lambda: diagnosis_document(result, name) | {"own_effect": None},
        lambda: diagnosed(result, name, request.data, request.bench_words),
    )
    return int(check and result.verdict != "adequate")


def told_add(asked: AskedStill, request: Request, effect: str, out: Path, as_json: bool) -> None:
    """`rig add`. Raises ModelError for an effect that is none of noise, or is in the model already."""
    from calibrations.effect import find
    from calibrations.errors import ModelError

    chosen = find(effect, asked.effects)
    if "still" not in chosen.kinds:
        known = ", ".join(name for name, each in asked.effects.items() if "still" in each.kinds)
        raise ModelError(f"{effect} is no noise, and a still record shows noise alone; effects of noise: {known}")
    if asked.model.holds(effect):
        raise ModelError(f"{asked.model.name}: {effect} is in the model already")
    result = with_noise_next(add(chosen, asked.model, asked.still, asked.effects), request.bench_file)
    write_model(result.end, asked.model, out)
    _emit(as_json, lambda: discovery_document(result, str(out)), lambda: added(result, request.data, str(out)))


def told_discover(asked: AskedStill, request: Request, out: Path | None, check: bool, as_json: bool) -> int:
    """`rig discover`."""
    result = with_noise_next(discover(asked.still, asked.model, asked.effects), request.bench_file)
    written = str(out) if out else None
    if out is not None:
        write_model(result.end, asked.model, out)
    _emit(
        as_json,
        lambda: discovery_document(result, written) | {"own_effect": None},
        lambda: discovered(result, request.data, written),
    )
    return int(check and result.verdict != "adequate")


def _emit(as_json: bool, document: Callable[[], dict[str, Any]], text: Callable[[], str]) -> None:
    if as_json:
        emit(document())
    else:
        click.echo(text())
