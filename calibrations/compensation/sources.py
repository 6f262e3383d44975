"""The compensation as source text: C99 (header, source, self-test), and one Python file without dependencies.

The templates have the text. The C code allocates nothing and has one loop of fixed length. The only state is the
history of a model with memory: a structure, or a list, that the caller owns.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from calibrations.compensation.cost import PASSES
from calibrations.compensation.document import Origin, ReferenceVectors, header_lines, unit_of_input
from calibrations.compensation.graph import OPERATIONS
from calibrations.compensation.inverse import Compensation
from calibrations.compensation.program import Program, ProgramLine

SUFFIX = {"double": "", "float": "f"}


def c_files(compensation: Compensation, origin: Origin, checks: ReferenceVectors) -> dict[str, str]:
    """Header, source and self-test in C99, by file name."""
    name, suffix = origin.name, SUFFIX[compensation.precision]

    def literal(word: str | float) -> str:
        return word if isinstance(word, str) else f"{word!r}{suffix}"

    def operand(value: float) -> str:
        return f"({literal(value)})" if value < 0 else literal(value)

    def expression(line: ProgramLine) -> str:
        return OPERATIONS[line.operation].c.format(*map(literal, line.inner), f=suffix)

    def comment(line: str) -> str:
        return f" * {line}".rstrip().replace("*/", "* /").replace("/*", "/ *")

    templates = _templates(literal, expression, comment)
    templates.filters["operand"] = operand
    templates.tests["used_after"] = lambda output: _is_used_later(output, compensation.program)
    values = _values(compensation, origin, checks) | {
        "suffix": suffix,
        "memory": f", {name}_memory *memory" if compensation.program.remembered else "",
        "tolerance": f"{checks.tolerance:g}",
        "unit_of_input": unit_of_input,
    }
    files = {f"{name}.h": "header.h", f"{name}.c": "source.c", f"{name}_self_test.c": "self_test.c"}
    return {file: templates.get_template(f"{template}.jinja").render(values) for file, template in files.items()}


def python_files(compensation: Compensation, origin: Origin, checks: ReferenceVectors) -> dict[str, str]:
    """The Python file by its name."""

    def literal(word: str | float) -> str:
        return word if isinstance(word, str) else repr(word)

    def expression(line: ProgramLine) -> str:
        return OPERATIONS[line.operation].python.format(*map(literal, line.inner))

    templates = _templates(literal, expression, lambda line: f"# {line}".rstrip())
    templates.filters["tuple"] = lambda names: ", ".join(names) if len(names) > 1 else f"({names[0]},)"
    memory = ["memory"] if compensation.program.remembered else []
    values = _values(compensation, origin, checks) | {"memory": memory}
    return {f"{origin.name}.py": templates.get_template("module.py.jinja").render(values)}


def _templates(
    literal: Callable[[str | float], str], expression: Callable[[ProgramLine], str], comment: Callable[[str], str]
) -> Environment:
    """The templates, with how a language writes an operand, a line of the program and a comment."""
    templates = Environment(  # noqa: S701 source code, not HTML
        loader=PackageLoader("calibrations.compensation"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    templates.filters |= {"literal": literal, "expression": expression, "comment": comment}
    return templates


def _values(compensation: Compensation, origin: Origin, checks: ReferenceVectors) -> dict[str, Any]:
    """The variables of the templates of all languages."""
    vectors = zip(map(tuple, checks.inputs.tolist()), map(tuple, checks.expected.tolist()), strict=True)
    return {
        "name": origin.name,
        "about": header_lines(compensation, origin),
        "compensation": compensation,
        "program": compensation.program,
        "checks": checks,
        "vectors": list(vectors),
        "in_gravity": compensation.costs.out_of_gravity is not None,
        "passes": PASSES,
    }


def _is_used_later(output: str, program: Program) -> bool:
    """Whether stored values depend on an output: compilers warn of unused variables."""
    return any(output in line.inner for line in program.after) or output in program.remembered.values()
