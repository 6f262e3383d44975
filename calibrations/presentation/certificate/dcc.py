"""The certificate as PTB's Digital Calibration Certificate, DCC 3.2.0: for machines, values in SI units.

Results as found and as left are lists of quantities, each with its expanded uncertainty, its budget and its statement
of conformity as metadata. A list of correlation coefficients for each result follows, for programs that read lists, and
all results as one vector with their covariance matrix, as D-SI has it. The whole certificate as JSON, with the digest
and weight of every row, is the attached document.

Source  https://ptb.de/dcc/v3.2.0/; D-SI 2.1.0, https://ptb.de/si.
"""

from __future__ import annotations

import base64
import json
import xml.etree.ElementTree as ET
from collections.abc import Iterable

import numpy as np
from scipy.special import chdtri

from calibrations.presentation.certificate.content import (
    RULE,
    UNSTATED,
    Certificate,
    Condition,
    Instrument,
    Outcome,
    document,
)
from calibrations.presentation.certificate.terms import in_si, product_in_si

VERSION = "3.2.0"
DCC, SI, XSI = "https://ptb.de/dcc", "https://ptb.de/si", "http://www.w3.org/2001/XMLSchema-instance"
LANGUAGE = "en"
PROBABILITY = "0.95"
LEVEL = float(PROBABILITY)
SCHEMA = f"{DCC} {DCC}/v{VERSION}/dcc.xsd"


def dcc(c: Certificate) -> str:
    """The XML document. Raises DataError for a unit without an SI form."""
    for prefix, space in (("dcc", DCC), ("si", SI), ("xsi", XSI)):
        ET.register_namespace(prefix, space)
    root = ET.Element(
        _dcc("digitalCalibrationCertificate"), {"schemaVersion": VERSION, f"{{{XSI}}}schemaLocation": SCHEMA}
    )
    root.append(_administration(c))
    results = _in(root, "measurementResults")
    results.append(_measurement(c))
    root.append(_attached(c))
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _administration(c: Certificate) -> ET.Element:
    data = ET.Element(_dcc("administrativeData"))
    data.append(_software("dccSoftware", c.program))
    core = _in(data, "coreData")
    _in(core, "countryCodeISO3166_1", c.laboratory.country)
    _in(core, "usedLangCodeISO639_1", LANGUAGE)
    _in(core, "mandatoryLangCodeISO639_1", LANGUAGE)
    _in(core, "uniqueIdentifier", c.number)
    _in(core, "beginPerformanceDate", c.began[:10])
    _in(core, "endPerformanceDate", c.ended[:10])
    _in(core, "performanceLocation", "laboratory")
    _in(core, "issueDate", c.issued)
    item = _in(_in(data, "items"), "item")
    _text(item, "name", c.sensor)
    _text(_in(item, "manufacturer"), "name", c.manufacturer)
    _in(item, "model", c.sensor)
    item.append(_identifications([("manufacturer", c.serial, "serial number", "basic_serialNumber")]))
    laboratory = _in(_in(data, "calibrationLaboratory"), "contact")
    _text(laboratory, "name", c.laboratory.name)
    if c.laboratory.email:
        _in(laboratory, "eMail", c.laboratory.email)
    _place(laboratory, c)
    person = _in(_in(data, "respPersons"), "respPerson")
    _text(_in(person, "person"), "name", c.laboratory.person)
    _in(person, "role", c.laboratory.role)
    _in(person, "mainSigner", "true")
    customer = _in(data, "customer")
    _text(customer, "name", c.customer)
    _in(_in(customer, "location"), "countryCode", c.laboratory.country if c.customer == c.laboratory.name else "ZZ")
    if remarks := (*c.figures.remarks, *c.remarks):
        statements = _in(data, "statements")
        for text in remarks:
            _rich(_in(statements, "statement"), "declaration", [text])
    return data


def _measurement(c: Certificate) -> ET.Element:
    result = ET.Element(_dcc("measurementResult"))
    _text(result, "name", f"Calibration by {c.procedure}")
    methods = _in(result, "usedMethods")
    _method(
        methods,
        c.procedure,
        [f"{name}: {value}" for name, value in c.facts.items()],
        ["IEEE Std 1293", "IEEE Std 2700"],
    )
    trials = f"checked by the propagation of distributions, {c.figures.trials} trials"
    _method(methods, "uncertainty", ["GUM budget with effective degrees of freedom", trials], ["JCGM 100", "JCGM 101"])
    if c.reference:
        _method(methods, "reference", [c.reference], [])
    _method(methods, "decision rule", [RULE], ["JCGM 106", "ISO/IEC 17025"])
    result.append(_software("usedSoftware", c.program))
    if c.instruments:
        equipments = _in(result, "measuringEquipments")
        for instrument in c.instruments:
            equipments.append(_equipment(instrument))
    influences = _in(result, "influenceConditions")
    gravity = Condition("local gravity", "m/s^2", c.gravity_m_s2, c.gravity_m_s2, c.gravity_m_s2)
    for condition in (gravity, *c.conditions):
        influences.append(_condition(condition, c))
    results = _in(result, "results")
    results.append(_outcomes("As left", "basic_measuredValue", c.figures.outcomes, c))
    if found := [(o, o.found[0]) for o in c.figures.outcomes if o.found is not None]:
        results.append(_as_found(found, c))
    if len(c.figures.outcomes) > 1:
        results.append(_correlations(c))
        results.append(_covariances(c))
    return result


def _correlations(c: Certificate) -> ET.Element:
    """A list for each result: its correlation coefficients with all of them, in the order of the results."""
    result, data = _result("Correlation coefficients")
    labels = " ".join(o.name for o in c.figures.outcomes)
    for o, row in zip(c.figures.outcomes, c.figures.correlations, strict=True):
        quantity = _in(data, "quantity")
        _text(quantity, "name", o.name)
        values = ET.SubElement(quantity, _si("realListXMLList"))
        _si_in(values, "labelXMLList", labels)
        _si_in(values, "valueXMLList", " ".join(f"{r:.6f}" for r in row))
        _si_in(values, "unitXMLList", "\\one")
    return result


def _covariances(c: Certificate) -> ET.Element:
    """All results as one vector, with the covariance matrix as its ellipsoidal region of 95 %, in SI units."""
    result, data = _result("Results with their covariance matrix")
    quantity = _in(data, "quantity")
    _text(quantity, "name", "results")
    values = ET.SubElement(ET.SubElement(quantity, _si("list")), _si("realList"))
    in_si_each = [in_si(o.unit, c.gravity_m_s2) for o in c.figures.outcomes]
    for o, (factor, unit) in zip(c.figures.outcomes, in_si_each, strict=True):
        real = ET.SubElement(values, _si("real"))
        _si_in(real, "label", o.name)
        _si_in(real, "value", repr(factor * o.value))
        _si_in(real, "unit", unit)
    region = ET.SubElement(values, _si("ellipsoidalRegion"))
    matrix = ET.SubElement(region, _si("covarianceMatrix"))
    stds = [factor * o.std for o, (factor, _) in zip(c.figures.outcomes, in_si_each, strict=True)]
    for j, second in enumerate(c.figures.outcomes):
        column = ET.SubElement(matrix, _si("column"))
        for i, first in enumerate(c.figures.outcomes):
            covariance = ET.SubElement(column, _si("covariance"))
            _si_in(covariance, "value", repr(c.figures.correlations[i][j] * stds[i] * stds[j]))
            _si_in(covariance, "unit", product_in_si(first.unit, second.unit))
    _si_in(region, "coverageFactor", f"{np.sqrt(chdtri(len(stds), 1 - LEVEL)):.4f}")
    _si_in(region, "coverageProbability", PROBABILITY)
    return result


def _outcomes(name: str, kind: str, outcomes: Iterable[Outcome], c: Certificate) -> ET.Element:
    result, data = _result(name)
    for o in outcomes:
        quantity = _quantity(data, o, kind)
        factor, unit = in_si(o.unit, c.gravity_m_s2)
        real = ET.SubElement(quantity, _si("real"))
        _si_in(real, "value", repr(factor * o.value))
        _si_in(real, "unit", unit)
        uncertainty = ET.SubElement(real, _si("expandedUnc"))
        _si_in(uncertainty, "uncertainty", repr(abs(factor) * o.expanded))
        _si_in(uncertainty, "coverageFactor", f"{o.coverage:.4f}")
        _si_in(uncertainty, "coverageProbability", PROBABILITY)
        quantity.append(_about(o, c))
    return result


def _as_found(outcomes: Iterable[tuple[Outcome, float]], c: Certificate) -> ET.Element:
    result, data = _result("As found")
    for o, value in outcomes:
        quantity = _quantity(data, o, "basic_measuredValue")
        factor, unit = in_si(o.unit, c.gravity_m_s2)
        real = ET.SubElement(quantity, _si("real"))
        _si_in(real, "value", repr(factor * value))
        _si_in(real, "unit", unit)
    return result


def _result(name: str) -> tuple[ET.Element, ET.Element]:
    result = ET.Element(_dcc("result"))
    _text(result, "name", name)
    return result, _in(_in(result, "data"), "list")


def _quantity(data: ET.Element, o: Outcome, kind: str) -> ET.Element:
    quantity = _in(data, "quantity")
    quantity.set("refType", kind)
    _text(quantity, "name", o.name)
    _rich(quantity, "description", [f"{o.term}{f', axis {o.axis}' if o.axis else ''}; effect {o.effect}"])
    return quantity


def _about(o: Outcome, c: Certificate) -> ET.Element:
    """Budget and conformity of a result."""
    factor, unit = in_si(o.unit, c.gravity_m_s2)
    data = ET.Element(_dcc("measurementMetaData"))
    budget = _in(data, "metaData")
    _text(budget, "name", "uncertainty budget")
    lines = [
        f"{s.name}: type {s.kind}, {abs(factor) * s.contribution:.3g} {unit}"
        + (f", sensitivity {s.sensitivity:.3g} {o.unit} per {s.unit}, u = {s.std:.3g}" if s.std is not None else "")
        + f", degrees of freedom {s.freedom:.4g}"
        for s in o.sources
    ]
    _rich(budget, "declaration", [*lines, f"effective degrees of freedom {o.freedom:.4g}"])
    if o.decision is not None:
        statement = _in(data, "metaData")
        _text(statement, "name", "statement of conformity")
        limits = f"limits {factor * o.decision.low:.6g} to {factor * o.decision.high:.6g} {unit}"
        _rich(statement, "declaration", [limits, f"probability of conformity {o.decision.probability:.4f}"])
        _in(statement, "conformity", o.decision.statement)
    return data


def _condition(condition: Condition, c: Certificate) -> ET.Element:
    element = ET.Element(_dcc("influenceCondition"))
    _text(element, "name", condition.name)
    data = _in(element, "data")
    for name in ("low", "mean", "high"):
        quantity = _in(data, "quantity")
        _text(quantity, "name", name)
        factor, unit = in_si(condition.unit, c.gravity_m_s2)
        real = ET.SubElement(quantity, _si("real"))
        _si_in(real, "value", repr(factor * getattr(condition, name)))
        _si_in(real, "unit", unit)
    return element


def _equipment(instrument: Instrument) -> ET.Element:
    element = ET.Element(_dcc("measuringEquipment"))
    _text(element, "name", f"{instrument.role}: {instrument.model}")
    if instrument.certificate:
        certificate = _in(element, "certificate")
        _text(certificate, "referral", "calibration certificate")
        _in(certificate, "referralID", instrument.certificate)
        _in(certificate, "procedure", "none")
        _in(certificate, "value", "none")
        _in(certificate, "inValidityRange", "false" if instrument.expired else "true")
    _in(element, "model", instrument.model or UNSTATED)
    ids = [("manufacturer", instrument.serial, "serial number", "basic_serialNumber")] if instrument.serial else []
    ids += [("manufacturer", instrument.firmware, "firmware", "basic_firmware")] if instrument.firmware else []
    if ids:
        element.append(_identifications(ids))
    return element


def _attached(c: Certificate) -> ET.Element:
    element = ET.Element(_dcc("document"))
    _text(element, "name", "the whole certificate as JSON, with the digest and weight of every row of the data")
    _in(element, "fileName", "certificate.json")
    _in(element, "mimeType", "application/json")
    text = json.dumps(document(c), allow_nan=False, ensure_ascii=False)
    _in(element, "dataBase64", base64.b64encode(text.encode()).decode())
    return element


def _software(tag: str, program: str) -> ET.Element:
    element = ET.Element(_dcc(tag))
    software = _in(element, "software")
    name, _, release = program.rpartition(" ")
    _text(software, "name", name)
    _in(software, "release", release)
    return element


def _method(methods: ET.Element, name: str, texts: list[str], norms: list[str]) -> None:
    method = _in(methods, "usedMethod")
    _text(method, "name", name)
    if texts:
        _rich(method, "description", texts)
    for norm in norms:
        _in(method, "norm", norm)


def _identifications(given: Iterable[tuple[str, str, str, str]]) -> ET.Element:
    element = ET.Element(_dcc("identifications"))
    for issuer, value, name, kind in given:
        one = _in(element, "identification")
        one.set("refType", kind)
        _in(one, "issuer", issuer)
        _in(one, "value", value)
        _text(one, "name", name)
    return element


def _place(contact: ET.Element, c: Certificate) -> None:
    lab, location = c.laboratory, _in(contact, "location")
    for tag, value in (
        ("city", lab.city),
        ("countryCode", lab.country),
        ("postCode", lab.post_code),
        ("street", lab.street),
    ):
        if value:
            _in(location, tag, value)


def _text(parent: ET.Element, tag: str, text: str) -> ET.Element:
    """A text of one language."""
    element = _in(parent, tag)
    content = _in(element, "content", text)
    content.set("lang", LANGUAGE)
    return element


def _rich(parent: ET.Element, tag: str, texts: Iterable[str]) -> None:
    element = _in(parent, tag)
    for text in texts:
        _in(element, "content", text).set("lang", LANGUAGE)


def _in(parent: ET.Element, tag: str, text: str = "") -> ET.Element:
    """A child; where it is a single word or more, blanks at its ends and in a row are left out, as the schema wants."""
    element = ET.SubElement(parent, _dcc(tag))
    if text:
        element.text = " ".join(text.split())
    return element


def _si_in(parent: ET.Element, tag: str, text: str) -> None:
    ET.SubElement(parent, _si(tag)).text = text


def _dcc(tag: str) -> str:
    return f"{{{DCC}}}{tag}"


def _si(tag: str) -> str:
    return f"{{{SI}}}{tag}"
