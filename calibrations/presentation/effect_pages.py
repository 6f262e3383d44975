"""A page of Markdown and a picture for each effect, made from its file.

    python -m calibrations.presentation.effect_pages docs/effects

The file stays the only place where an effect is described; a test fails when a page is not what its file says.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from calibrations.compensation.forward import known_at_run_time
from calibrations.effects import Effect, Parameter
from calibrations.effects.catalogue import catalogue
from calibrations.presentation.charts.signature import noise_signature_chart, shown_noise, shown_value, signature_chart
from calibrations.presentation.smaller_svg import compact_svg
from calibrations.presentation.static import svg

ACTS_ON = {
    "pose": "the pose: the true position of the stages and of the vertical",
    "force": "the specific force: its component along each sensing axis",
    "transduction": "the transduction: from specific force to output",
    "output": "the output: filter, converter and other changes after the transduction",
    "spectrum": "the spectrum of a still record: noise",
    "lines": "the spectrum of a still record: tones",
}

SOURCES = """
Sources: *Ang* is Ang, Khoo, Khosla and Riviere, "Physical Model of a MEMS Accelerometer for Low-g Motion Tracking
Applications"; *Book* is a chapter 17, "MEMS Inertial Sensors and Magnetic Sensors", whose numbers are given.
"""


def page(effect: Effect) -> str:
    """The page of one effect."""
    sections = [
        ("Symptom", effect.symptom),
        ("Excited by", effect.excited_by),
        ("Confused with", effect.confused_with or "nothing in the catalogue"),
        ("Acts on", ACTS_ON[effect.acts_on] + "."),
        ("Needs", _required_data(effect)),
        ("At run time", f"{known_at_run_time(effect)}."),
        ("Source", effect.source),
    ]
    rows = "\n".join(_row(parameter) for parameter in effect.parameters)
    lines = "\n".join(f"- **{title}**: {text}" for title, text in sections)
    return (
        f"# {effect.name}\n\n{effect.summary[:1].upper()}{effect.summary[1:]}\n\n"
        f"![{_alternative(effect)}](pictures/{effect.name}.svg)\n\n{_caption(effect)}\n\n"
        f"```text\n{effect.formula}\n```\n\n{lines}\n\n"
        "| parameter | unit | values | range | meaning |\n| --- | --- | --- | --- | --- |\n"
        f"{rows}\n{_footnote(effect)}"
    )


def index(effects: Mapping[str, Effect]) -> str:
    """The list of all pages."""
    rows = "\n".join(_gallery(effect) for effect in effects.values())
    return (
        "# The catalogue of physical effects\n\n"
        "Made by `python -m calibrations.presentation.effect_pages docs/effects` from the files in\n"
        "`calibrations/effects`; `rig effects NAME` shows the same in a terminal. The pictures show the residual of\n"
        "the linear model without noise; those of noise show its contribution to white noise.\n\n"
        f"| effect | acts on | what happens | residual |\n| --- | --- | --- | --- |\n{rows}\n{SOURCES}"
    )


def pages(effects: Mapping[str, Effect]) -> dict[str, str]:
    """All pages by file name."""
    effects = dict(sorted(effects.items()))
    return {"README.md": index(effects)} | {f"{name}.md": page(effect) for name, effect in effects.items()}


def drawing(effect: Effect) -> str:
    """The effect's picture as an SVG document; the same effect gives the same text."""
    chart = noise_signature_chart(effect) if effect.is_noise else signature_chart(effect)
    return compact_svg(svg(chart).decode())


def write(folder: Path) -> None:
    """Write all pages and pictures, and remove those of removed effects."""
    effects = catalogue()
    files = pages(effects) | {f"pictures/{effect.name}.svg": drawing(effect) for effect in effects.values()}
    for stale in {*folder.glob("*.md"), *folder.glob("pictures/*.svg")} - {folder / name for name in files}:
        stale.unlink()
    (folder / "pictures").mkdir(exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


def _alternative(effect: Effect) -> str:
    if effect.is_noise:
        return f"Contribution of {effect.name} to white noise"
    return f"Residual of {effect.first_kind.perfect_sensor} with {effect.name}"


def _caption(effect: Effect) -> str:
    """The caption of the picture, with the size of the effect."""
    if effect.is_noise:
        return _caption_of_noise(effect)
    incomplete = {"bias": "a model without a bias", "scale-factor": "a model without a scale factor"}
    kind = effect.first_kind
    perfect_model, turned = kind.perfect_sensor, kind.field or kind.turning
    values = [_value(p, effect) for p in effect.parameters if turned or not p.where]
    model, names = incomplete.get(effect.name, perfect_model), ", ".join(values)
    return f"Residual of {model} for a sensor{kind.nominal} with {names}, without noise."


def _caption_of_noise(effect: Effect) -> str:
    units = {p.name: p.unit.replace("{out}", "V") for p in effect.parameters}
    values = [f"{name.replace('_', ' ')} {value:g} {units[name]}" for name, value in shown_noise(effect).items()]
    return (
        "Allan deviation, and one-sided density, of a still record at 10 Hz: broken line: white noise alone "
        "(coefficient "
        f"1 V/sqrt(Hz)); full line: with {', '.join(values)}{'' if effect.name == 'white-noise' else ' beside it'}."
    )


def _value(p: Parameter, effect: Effect) -> str:
    value = np.atleast_1d(shown_value(p, effect))
    unit = "" if p.unit == "1" else f" {p.unit.replace('{out}', 'V')}"
    if effect.first_kind.field:
        unit = ""  # a share of the field
    of_y = f" ({value[1]:g} for y)" if len(value) > 1 and value[1] != value[0] else ""
    return f"{p.name.replace('_', ' ')} {value[0]:g}{unit}{of_y}"


def _gallery(e: Effect) -> str:
    """A row of the list, with the picture as it fits there."""
    image = f'<img src="pictures/{e.name}.svg" alt="{_alternative(e)}" width="330">'
    return f"| [{e.name}]({e.name}.md) | {e.acts_on} | {e.summary.rstrip('.')} | [{image}]({e.name}.md) |"


def _required_data(effect: Effect) -> str:
    columns = " and ".join(f"the column `{name}`" for name in effect.needs)
    return f"data of {' or '.join(effect.kinds)}" + (f", with {columns}." if columns else ".")


def _row(p: Parameter) -> str:
    values = "one per axis" if p.per_axis else "one"
    if p.measured:
        values += f", if the {p.measured} axis is measured"
    if p.where:
        values += f", where {p.where}"
    span = "any" if np.isinf(p.low) and np.isinf(p.high) else f"{p.low:g} to {p.high:g}"
    return f"| `{p.name}` | {p.unit} | {values} | {span} | {p.doc or '-'} |"


def _footnote(effect: Effect) -> str:
    if not any("{out}" in p.unit for p in effect.parameters):
        return ""
    return "\n{out} is the unit of the sensor's output: V for poses and motion, else the unit of the data.\n"


if __name__ == "__main__":
    write(Path(sys.argv[1]))
