"""The fleet's report: one HTML page on missing effects of batches, errors of rigs, and sensors to inspect."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from calibrations.fleet.batch import BatchVerdict, Population, SensorVerdict
from calibrations.presentation.chart import Picture
from calibrations.presentation.charts.fleet import Spread, rigs, shares, spreads
from calibrations.presentation.document import Block, Page, Remark, Section, Table
from calibrations.presentation.page import html
from calibrations.text import count_words, estimate_text, join_words, probability, rounded

MOST = 200  # sensors in a table of those that need a person
ONE_RIG = (
    "All sensors were measured on one rig. An error of its stages cannot be separated from a common error of the "
    "sensors."
)
SHARED = (
    "If all sensors of one rig have an error that the sensors of other rigs do not have, it is an error of the rig. "
    "Values are relative to the median of the rigs. An error of all rigs appears as an error of the sensors' design."
)


def population_report(population: Population, model: str, facts: Mapping[str, str]) -> str:
    """The page of a discovery as HTML text; `facts` its provenance."""
    persons = [sensor for sensor in population.sensors if sensor.needs_a_person]
    faulty_rigs = {error.rig for error in population.rigs if error.beyond}
    missing = [batch for batch in population.batches if batch.effects]
    batches = f"of {count_words(len(population.batches), 'batch', 'batches')}"
    state = "found" if missing or faulty_rigs or persons else "adequate"
    return html(
        Page(
            headline=_headline(missing, faulty_rigs, persons),
            verdict=state,
            state=state,
            subject=f"Fleet, {len(population.sensors)} sensors",
            summary=f"Each sensor was compared with the model {model}, then with the model of its batch, on poses "
            "corrected for the errors of its rig. Sensors that differ from their batch were diagnosed in full.",
            figures=[
                ("sensors", str(len(population.sensors)), batches),
                ("batches that miss an effect", str(len(missing)), "in all their sensors"),
                ("rigs in error", str(len(faulty_rigs)), "against the median of the rigs"),
                ("sensors to inspect", str(len(persons)), "unlike their batch, or without a verdict"),
            ],
            sections=[_batches(population), _rigs(population), *_persons(persons)],
            provenance=facts,
        )
    )


def calibration_report(
    quantities: Mapping[str, Sequence[Spread]], batches: Section, count: int, subject: str, facts: Mapping[str, str]
) -> str:
    """The page of a calibration: `quantities` by name over `count` batches, means and spreads of these."""
    caption = (
        "Each sensor's value with its 95 % interval, estimated with its batch; the grey band holds 95 % of the "
        "batch. Sensors unlike all others of their batch are named and do not use its values."
    )
    picture = Picture("spreads", "The sensors of each batch", caption, spreads(quantities))
    outlier_count = sum(int(spread.outliers.sum()) for values in quantities.values() for spread in values)
    return html(
        Page(
            headline=f"{subject}: calibrated together with their batches",
            verdict="calibrated",
            state="adequate",
            subject="Fleet",
            summary="The model assumes that the parameters of a batch's sensors are from one population, whose mean "
            "and spread are estimated with them. A sensor with little data of its own gains most.",
            figures=[("batches", str(count), ""), ("values unlike the rest", str(outlier_count), "")],
            sections=[Section("Parameters", (picture,)), batches],
            provenance=facts,
        )
    )


def _headline(missing: list[BatchVerdict], faulty_rigs: set[str], persons: list[SensorVerdict]) -> str:
    parts = []
    if missing:
        effects = join_words(list(dict.fromkeys(e.effect for batch in missing for e in batch.effects)))
        parts.append(f"{effects} missing in {count_words(len(missing), 'batch', 'batches')}")
    if faulty_rigs:
        parts.append(f"{count_words(len(faulty_rigs), 'rig', 'rigs')} in error")
    if persons:
        parts.append(f"{count_words(len(persons), 'sensor', 'sensors')} to inspect")
    text = join_words(parts) or "no effect is missing in any sensor"
    return f"{text[:1].upper()}{text[1:]}."


def _batches(population: Population) -> Section:
    blocks: list[Block] = [
        "An effect belongs to a batch if its sensors show it together, even if no single sensor shows it significantly."
    ]
    if any(batch.shares for batch in population.batches):
        caption = "Share of a batch's sensors that have the effect; 100 % if the batch as a whole shows it."
        blocks.append(Picture("shares", "Effects and batches", caption, shares(population)))
    rows = [
        (
            batch.batch or "no batch",
            batch.sensors,
            effect.effect,
            "common" if effect.common else "individual",
            f"{effect.sensors} of {effect.of}",
            probability(effect.p_value),
            ", ".join(effect.rivals) or "-",
        )
        for batch in population.batches
        for effect in batch.effects
    ]
    head = ("batch", "sensors", "effect", "values", "significant alone", "p-value", "inseparable from")
    return Section("Batches", (*blocks, *_table("Batches", head, rows)))


def _rigs(population: Population) -> Section:
    blocks: list[Block] = []
    measured_on = {rig for group in population.unconnected for rig in group}
    if len(measured_on) == 1:
        blocks.append(ONE_RIG)
    elif len(population.unconnected) > 1:
        groups = "; ".join(join_words(list(group)) for group in population.unconnected)
        blocks.append(f"These groups of rigs have no batch in common and cannot be compared: {groups}.")
    if not population.rigs and not blocks:
        blocks.append("No rig differs significantly from the others.")
    if population.rigs:
        caption = "Error of each rig with its expanded uncertainty (k = 2); significant errors are red."
        blocks += [SHARED, Picture("rigs", "Errors of the rigs", caption, rigs(population.rigs))]
    rows = [
        (e.rig, e.effect, e.parameter, f"{estimate_text(e.value, e.std)} {e.unit}", probability(e.p_value), e.sensors)
        for e in population.rigs
        if e.beyond
    ]
    head = ("rig", "effect", "parameter", "value", "p-value", "sensors")
    return Section("Rigs", (*blocks, *_table("Rigs", head, rows)))


def _persons(sensors: list[SensorVerdict]) -> Iterable[Section]:
    if not sensors:
        return
    rows = [
        (
            sensor.sensor,
            sensor.batch or "-",
            sensor.rig or "-",
            sensor.verdict,
            ", ".join(sensor.own) or "-",
            "-" if sensor.excess is None else rounded(sensor.excess),
            sensor.remark or "-",
        )
        for sensor in sensors[:MOST]
    ]
    head = ("sensor", "batch", "rig", "verdict", "own effects", "error / floor", "remark")
    remarks = (Remark(f"{len(sensors) - MOST} more are in the JSON document."),) if len(sensors) > MOST else ()
    yield Section("Sensors to inspect", (*_table("Sensors to inspect", head, rows), *remarks))


def _table(title: str, head: Sequence[str], rows: Sequence[Sequence[object]]) -> tuple[Table, ...]:
    """The table, where it has rows."""
    return (Table(title, head, rows, headed=False),) if rows else ()
