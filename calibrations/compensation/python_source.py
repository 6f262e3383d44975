"""The compensation as one Python file without dependencies."""

from __future__ import annotations

from calibrations.compensation.cost import PASSES
from calibrations.compensation.document import Origin, ReferenceVectors, header_lines
from calibrations.compensation.graph import OPERATIONS
from calibrations.compensation.inverse import Compensation
from calibrations.compensation.program import Line


def files(made: Compensation, origin: Origin, checks: ReferenceVectors) -> dict[str, str]:
    """The file by its name."""
    program = made.program
    about = "\n".join(f"# {line}".rstrip() for line in header_lines(made, origin))
    before = "".join(_line(line, "    ") for line in program.before)
    loop = "".join(_line(line, "        ") for line in program.loop)
    sought = ", ".join(program.sought)
    ends = ", ".join(_word(word) for word in program.next)
    pairs = zip(checks.inputs.tolist(), checks.expected.tolist(), strict=True)
    rows = "".join(f"    ({tuple(given)}, {tuple(true)}),\n" for given, true in pairs)
    text = f'''{about}

import math

STEPS = {program.steps}
TOLERANCE = {checks.tolerance!r}
VECTORS = (  # inputs that the model makes of true values, and the true values
{rows})


{_tables(made)}{_declared_memory(made)}def compensate({", ".join([*program.inputs, *_memory(made)])}):
    """Return ({sought}) in {made.unit}{"; `memory` is then that of the next sample" if _memory(made) else ""}."""
{_recalled(made)}{before}    {" = ".join(program.sought)} = 0.0
    for _ in range(STEPS):
{loop}        {sought} = {ends}
{_remembered(made)}    return {_tuple(program.sought)}

{_in_gravity(made)}
def self_test():
    """Return how many of the reference vectors fail: 0 is good."""
{"    memory = begin()" + chr(10) if _memory(made) else ""}    errors = [
        max(abs(a - b) for a, b in zip(compensate(*given{", memory" if _memory(made) else ""}), true))
        for given, true in VECTORS
    ]
    return sum(not error <= TOLERANCE for error in errors)


if __name__ == "__main__":
    failed = self_test()
    print(f"{{failed}} of {{len(VECTORS)}} reference vectors fail")
    raise SystemExit(failed != 0)
'''
    return {f"{origin.name}.py": text}


def _tables(made: Compensation) -> str:
    """A function for each table."""
    return "".join(
        f'''{name.upper()} = (  # c0 + c1 u + c2 u^2 + c3 u^3 on each piece, u = 0..1
{"".join(f"    {piece},{chr(10)}" for piece in table.pieces)})


def {name}(x):
    """Return the curve at x; beyond the first and the last piece it is constant."""
    s = min(max(0.0, (x - {_word(table.low)}) / {_word(table.step)}), {float(len(table.pieces))!r})
    i = min(int(s), {len(table.pieces) - 1})
    c0, c1, c2, c3 = {name.upper()}[i]
    u = s - i
    return ((c3 * u + c2) * u + c1) * u + c0


'''
        for name, table in made.program.tables.items()
    )


def _memory(made: Compensation) -> list[str]:
    return ["memory"] if made.program.remembered else []


def _declared_memory(made: Compensation) -> str:
    if not _memory(made):
        return ""
    return f'''def begin():
    """Return what is remembered before the first sample, a list that `compensate` brings up to date."""
    return [0.0] * {len(made.program.remembered)}


'''


def _recalled(made: Compensation) -> str:
    return f"    {', '.join(made.program.remembered)}, = memory\n" if _memory(made) else ""


def _remembered(made: Compensation) -> str:
    """The stored values for the next sample."""
    program = made.program
    if not _memory(made):
        return ""
    lines = "".join(_line(line, "    ") for line in program.after)
    return f"{lines}    memory[:] = {', '.join(_word(word) for word in program.remembered.values())},\n"


def _in_gravity(made: Compensation) -> str:
    if made.costs.out_of_gravity is None:
        return ""
    others = [name for name in made.program.inputs if name != "az"]
    given = ", ".join(f"{name}={name}" for name in others)
    again, last = ("", "")
    if _memory(made):  # each pass begins with what was remembered before the sample
        given, again, last = f"{given}, memory=then", "then = list(memory)", "    memory[:] = then\n"
    return f'''
def in_gravity({", ".join([*others, "side", *_memory(made)])}):
    """The same where nothing but gravity acts; side is 1 where the z axis points up, else -1."""
{again and "    " + again + chr(10)}    ax, ay = compensate(az=0.0, {given})
    for _ in range({PASSES}):
        az = side * math.sqrt(max(0.0, 1.0 - ax * ax - ay * ay))
{again and "        " + again + chr(10)}        ax, ay = compensate(az=az, {given})
{last}    return ax, ay

'''


def _tuple(names: tuple[str, ...]) -> str:
    return ", ".join(names) if len(names) > 1 else f"({names[0]},)"


def _line(line: Line, indent: str) -> str:
    text = OPERATIONS[line.operation].python.format(*(_word(inner) for inner in line.inner))
    return f"{indent}{line.name} = {text}\n"


def _word(word: str | float) -> str:
    return word if isinstance(word, str) else repr(word)
