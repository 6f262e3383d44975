"""One page of Markdown for each effect, made from its file: `python -m calibrations.pages docs/effects`.

The file stays the only place where an effect is described; a test fails when a page is not what its file says.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from calibrations.effect import Effect, Parameter, catalogue

ACTS_ON = {
    "pose": "the pose: where the stages and the vertical really are",
    "force": "the specific force: what of it each sensing axis feels",
    "transduction": "the transduction: from specific force to output",
    "output": "the output: what becomes of it before it is a number",
}

SOURCES = """
Sources: *Ang* is Ang, Khoo, Khosla and Riviere, "Physical Model of a MEMS Accelerometer for Low-g Motion Tracking
Applications"; *Book* is a chapter 17, "MEMS Inertial Sensors and Magnetic Sensors", whose numbers are given.
"""


def page(effect: Effect) -> str:
    """The page of one effect."""
    about = [
        ("Symptom", effect.symptom),
        ("Excited by", effect.excited_by),
        ("Confused with", effect.confused_with or "nothing in the catalogue"),
        ("Acts on", ACTS_ON[effect.acts_on] + "."),
        ("Needs", _needs(effect)),
        ("Source", effect.source),
    ]
    rows = "\n".join(_row(parameter) for parameter in effect.parameters)
    lines = "\n".join(f"- **{title}**: {text}" for title, text in about)
    return (
        f"# {effect.name}\n\n{effect.summary[:1].upper()}{effect.summary[1:]}\n\n"
        f"```text\n{effect.formula}\n```\n\n{lines}\n\n"
        "| parameter | unit | values | range | meaning |\n| --- | --- | --- | --- | --- |\n"
        f"{rows}\n{_footnote(effect)}"
    )


def index(effects: Mapping[str, Effect]) -> str:
    """The list of all pages."""
    rows = "\n".join(f"| [{e.name}]({e.name}.md) | {e.acts_on} | {e.summary.rstrip('.')} |" for e in effects.values())
    return (
        "# The catalogue of physical effects\n\n"
        "Made by `python -m calibrations.pages docs/effects` from the files in `calibrations/effects`;\n"
        "`rig effects NAME` shows the same in a terminal.\n\n"
        f"| effect | acts on | what happens |\n| --- | --- | --- |\n{rows}\n{SOURCES}"
    )


def pages(effects: Mapping[str, Effect]) -> dict[str, str]:
    """All pages by file name."""
    effects = dict(sorted(effects.items()))
    return {"README.md": index(effects)} | {f"{name}.md": page(effect) for name, effect in effects.items()}


def write(folder: Path) -> None:
    """Write all pages, and remove those of effects that are no more."""
    made = pages(catalogue())
    for stale in set(folder.glob("*.md")) - {folder / name for name in made}:
        stale.unlink()
    for name, text in made.items():
        (folder / name).write_text(text, encoding="utf-8")


def _needs(effect: Effect) -> str:
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
    return "\n{out} is the unit of the sensor's output: V for poses and motion, the unit of the data for positions.\n"


if __name__ == "__main__":
    write(Path(sys.argv[1]))
