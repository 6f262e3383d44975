"""The compensation as one Python file, which needs nothing but Python itself."""

from __future__ import annotations

from calibrations.compensation.about import Origin, lines
from calibrations.compensation.cost import PASSES
from calibrations.compensation.inverse import Compensation
from calibrations.compensation.operations import OPERATIONS
from calibrations.compensation.program import Line
from calibrations.compensation.vectors import Vectors


def files(made: Compensation, origin: Origin, checks: Vectors) -> dict[str, str]:
    """The file by its name."""
    program = made.program
    about = "\n".join(f"# {line}".rstrip() for line in lines(made, origin))
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


def compensate({", ".join(program.inputs)}):
    """Return ({sought}) in {made.unit}."""
{before}    {" = ".join(program.sought)} = 0.0
    for _ in range(STEPS):
{loop}        {sought} = {ends}
    return {_tuple(program.sought)}

{_in_gravity(made)}
def self_test():
    """Return how many of the reference vectors fail: 0 is good."""
    errors = [max(abs(a - b) for a, b in zip(compensate(*given), true)) for given, true in VECTORS]
    return sum(not error <= TOLERANCE for error in errors)


if __name__ == "__main__":
    failed = self_test()
    print(f"{{failed}} of {{len(VECTORS)}} reference vectors fail")
    raise SystemExit(failed != 0)
'''
    return {f"{origin.name}.py": text}


def _in_gravity(made: Compensation) -> str:
    if made.costs.out_of_gravity is None:
        return ""
    others = [name for name in made.program.inputs if name != "az"]
    given = ", ".join(f"{name}={name}" for name in others)
    return f'''
def in_gravity({", ".join(others)}, side):
    """The same where nothing but gravity acts; side is 1 where the z axis points up, else -1."""
    ax, ay = compensate(az=0.0, {given})
    for _ in range({PASSES}):
        az = side * math.sqrt(max(0.0, 1.0 - ax * ax - ay * ay))
        ax, ay = compensate(az=az, {given})
    return ax, ay

'''


def _tuple(names: tuple[str, ...]) -> str:
    return ", ".join(names) if len(names) > 1 else f"({names[0]},)"


def _line(line: Line, indent: str) -> str:
    text = OPERATIONS[line.operation].python.format(*(_word(inner) for inner in line.inner))
    return f"{indent}{line.name} = {text}\n"


def _word(word: str | float) -> str:
    return word if isinstance(word, str) else repr(word)
