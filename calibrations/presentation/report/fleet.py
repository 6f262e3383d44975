"""The fleet's report: one HTML page on missing effects of batches, errors of rigs, and sensors to inspect."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from calibrations.fleet.batch import BatchVerdict, Population, SensorVerdict
from calibrations.presentation.chart import Picture
from calibrations.presentation.charts.fleet import Spread, rigs, shares, spreads
from calibrations.presentation.report.page import figure, page
from calibrations.text import estimate_text, joined, probability, rounded

MOST = 200  # sensors in a table of those that need a person
ONE_RIG = (
    "All sensors were measured on one rig. An error of its stages cannot be separated from a common error of the "
    "sensors."
)
SHARED = (
    "An error that the sensors of one rig share and those of other rigs do not is an error of the rig. Values are "
    "relative to the median of the rigs; an error common to all rigs appears as one of the sensors' design."
)
Section = dict[str, Any]


def population_report(found: Population, model: str, facts: Mapping[str, str]) -> str:
    """The page of a discovery as HTML text; `facts` its provenance."""
    persons = [each for each in found.sensors if each.needs_a_person]
    beyond = {error.rig for error in found.rigs if error.beyond}
    missing = [batch for batch in found.batches if batch.effects]
    return page(
        "fleet.html",
        headline=_headline(missing, beyond, persons),
        verdict="adequate" if not (missing or beyond or persons) else "found",
        state="adequate" if not (missing or beyond or persons) else "found",
        what=f"Fleet, {len(found.sensors)} sensors",
        summary=f"Each sensor was compared with the model {model}, then with the model of its batch, on poses "
        "corrected for the errors of its rig. Sensors that differ from their batch were diagnosed in full.",
        figures=[
            ("sensors", str(len(found.sensors)), f"of {len(found.batches)} batches"),
            ("batches that miss an effect", str(len(missing)), "in all their sensors"),
            ("rigs in error", str(len(beyond)), "against the median of the rigs"),
            ("sensors to inspect", str(len(persons)), "unlike their batch, or without a verdict"),
        ],
        sections=[_of_batches(found), *_of_rigs(found), *_of_persons(persons)],
        provenance=facts,
    )


def calibration_report(quantities: Mapping[str, Sequence[Spread]], tables: Section, what: str, facts: Any) -> str:
    """The page of a calibration: `quantities` by name over the batches, `tables` of means and spreads."""
    caption = (
        "Each sensor's value with its 95 % interval, estimated with its batch; the grey band holds 95 % of the "
        "batch. Sensors unlike all others of their batch are named and do not use its values."
    )
    drawn = Picture("spreads", "The sensors of each batch", caption, spreads(quantities))
    unlike = sum(int(each.apart.sum()) for of in quantities.values() for each in of)
    return page(
        "fleet.html",
        headline=f"{what}: calibrated together with their batches",
        verdict="calibrated",
        state="adequate",
        what="Fleet",
        summary="The model assumes that the parameters of a batch's sensors are from one population, whose mean "
        "and spread are estimated with them. A sensor with little data of its own gains most.",
        figures=[
            ("batches", str(len(tables["tables"][0]["batches"])), ""),
            ("values unlike the rest", str(unlike), ""),
        ],
        sections=[{"title": "Parameters", "words": [], "pictures": [figure(drawn)], "tables": []}, tables],
        provenance=facts,
    )


def _headline(missing: list[BatchVerdict], beyond: set[str], persons: list[SensorVerdict]) -> str:
    parts = []
    if missing:
        effects = joined(list(dict.fromkeys(e.effect for batch in missing for e in batch.effects)))
        parts.append(f"{effects} missing in {_count(len(missing), 'batch', 'batches')}")
    if beyond:
        parts.append(f"{_count(len(beyond), 'rig', 'rigs')} in error")
    if persons:
        parts.append(f"{_count(len(persons), 'sensor', 'sensors')} to inspect")
    text = joined(parts) or "no effect is missing in any sensor"
    return f"{text[:1].upper()}{text[1:]}."


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


def _of_batches(found: Population) -> Section:
    pictures = []
    if any(batch.shares for batch in found.batches):
        caption = "Share of a batch's sensors that have the effect; 100 % if the batch as a whole shows it."
        pictures.append(figure(Picture("shares", "Effects and batches", caption, shares(found))))
    rows = [
        (
            batch.batch or "no batch",
            batch.sensors,
            each.effect,
            "common" if each.common else "individual",
            f"{each.sensors} of {each.of}",
            probability(each.p_value),
            ", ".join(each.rivals) or "-",
        )
        for batch in found.batches
        for each in batch.effects
    ]
    words = "An effect belongs to a batch if its sensors show it together, even if it is significant in none alone."
    head = ("batch", "sensors", "effect", "values", "significant alone", "p-value", "inseparable from")
    return {"title": "Batches", "words": [words], "pictures": pictures, "tables": _table(head, rows)}


def _of_rigs(found: Population) -> Iterable[Section]:
    words = []
    measured_on = {rig for group in found.unconnected for rig in group}
    if len(measured_on) == 1:
        words.append(ONE_RIG)
    elif len(found.unconnected) > 1:
        groups = "; ".join(joined(list(group)) for group in found.unconnected)
        words.append(f"These groups of rigs have no batch in common and cannot be compared: {groups}.")
    if not found.rigs and not words:
        words.append("No rig differs significantly from the others.")
    pictures = []
    if found.rigs:
        words.append(SHARED)
        caption = "Error of each rig with its expanded uncertainty (k = 2); significant errors are red."
        pictures.append(figure(Picture("rigs", "Errors of the rigs", caption, rigs(found.rigs))))
    rows = [
        (e.rig, e.effect, e.parameter, f"{estimate_text(e.value, e.std)} {e.unit}", probability(e.p_value), e.sensors)
        for e in found.rigs
        if e.beyond
    ]
    head = ("rig", "effect", "parameter", "value", "p-value", "sensors")
    yield {"title": "Rigs", "words": words, "pictures": pictures, "tables": _table(head, rows)}


def _of_persons(persons: list[SensorVerdict]) -> Iterable[Section]:
    if not persons:
        return
    rows = [
        (
            each.sensor,
            each.batch or "-",
            each.rig or "-",
            each.verdict,
            ", ".join(each.own) or "-",
            "-" if each.excess is None else rounded(each.excess),
            each.remark or "-",
        )
        for each in persons[:MOST]
    ]
    head = ("sensor", "batch", "rig", "verdict", "own effects", "error / floor", "remark")
    more = f"{len(persons) - MOST} more are in the JSON document." if len(persons) > MOST else ""
    yield {"title": "Sensors to inspect", "words": [], "pictures": [], "tables": _table(head, rows, more)}


def _table(head: Sequence[str], rows: Sequence[Sequence[object]], more: str = "") -> list[dict[str, Any]]:
    return [{"head": head, "rows": rows, "more": more}] if rows else []
