"""The compensation as C99: a header, a source, and a self-test. No allocation, one loop of fixed length.

The only state is the history of a model with memory: a structure that the caller owns.
"""

from __future__ import annotations

from calibrations.compensation.cost import PASSES
from calibrations.compensation.document import Origin, ReferenceVectors, header_lines, unit_of_input
from calibrations.compensation.graph import OPERATIONS, Table
from calibrations.compensation.inverse import Compensation
from calibrations.compensation.program import Line

SUFFIX = {"double": "", "float": "f"}


def files(made: Compensation, origin: Origin, checks: ReferenceVectors) -> dict[str, str]:
    """The three files by name."""
    n = origin.name
    return {
        f"{n}.h": _header(made, origin),
        f"{n}.c": _source(made, n),
        f"{n}_self_test.c": _self_test(made, n, checks),
    }


def _header(made: Compensation, origin: Origin) -> str:
    n, program = origin.name, made.program
    about = (
        "\n".join(f" * {line}".rstrip() for line in header_lines(made, origin))
        .replace("*/", "* /")
        .replace("/*", "/ *")
    )
    inputs = "\n".join(f"    {n}_real {name}; /* {unit_of_input(name, made)} */" for name in program.inputs)
    outputs = "\n".join(f"    {n}_real {name}; /* {made.unit} */" for name in program.sought)
    return f"""/*
{about}
 */
#ifndef {n.upper()}_H
#define {n.upper()}_H

#ifdef __cplusplus
extern "C" {{
#endif

typedef {made.precision} {n}_real;

typedef struct {{
{inputs}
}} {n}_input;

typedef struct {{
{outputs}
}} {n}_output;

{_declared_memory(made, n)}{n}_output {n}_compensate(const {n}_input *in{_taking_memory(made, n)});
{_declared_in_gravity(made, n)}
/* How many of the reference vectors fail: 0 is good. In {n}_self_test.c; with {n.upper()}_MAIN defined, a program. */
int {n}_self_test(void);

#ifdef __cplusplus
}}
#endif
#endif
"""


def _source(made: Compensation, n: str) -> str:
    program, f = made.program, SUFFIX[made.precision]
    before = "".join(_line(line, n, f, "    ") for line in program.before)
    loop = "".join(_line(line, n, f, "        ") for line in program.loop)
    taken = "".join(f"    const {n}_real {name} = in->{name};\n" for name in program.inputs)
    taken += "".join(f"    const {n}_real {name} = memory->{name};\n" for name in program.remembered)
    begin = "".join(f"    out.{name} = 0;\n" for name in program.sought)
    sought = "".join(f"        const {n}_real {name} = out.{name};\n" for name in program.sought)
    end = "".join(f"        out.{a} = {_word(b, f)};\n" for a, b in zip(program.sought, program.next, strict=True))
    return f"""#include "{n}.h"

#include <math.h>

{_tables(made, n, f)}{n}_output {n}_compensate(const {n}_input *in{_taking_memory(made, n)})
{{
{taken}{before}    {n}_output out;
    int step;

{begin}    for (step = 0; step < {program.steps}; ++step) {{
{sought}{loop}{end}    }}
{_remembered(made, n, f)}    return out;
}}
{_in_gravity(made, n, f)}"""


def _tables(made: Compensation, n: str, f: str) -> str:
    """A function for each table."""
    return "".join(_table(name, table, n, f) for name, table in made.program.tables.items())


def _table(name: str, table: Table, n: str, f: str) -> str:
    last = len(table.pieces)
    rows = "".join(f"        {{{', '.join(_word(c, f) for c in piece)}}},\n" for piece in table.pieces)
    return f"""/* A curve: c0 + c1 u + c2 u^2 + c3 u^3 on each piece, u = 0..1, and constant beyond the last piece. */
static {n}_real {name}(const {n}_real x)
{{
    static const {n}_real pieces[{last}][4] = {{
{rows}    }};
    {n}_real s = (x - {_operand(table.low, f)}) / {_word(table.step, f)};
    {n}_real u;
    int i;

    s = s > 0 ? s : 0;
    s = s < {last} ? s : {last};
    i = s < {last - 1} ? (int)s : {last - 1};
    u = s - ({n}_real)i;
    return ((pieces[i][3] * u + pieces[i][2]) * u + pieces[i][1]) * u + pieces[i][0];
}}

"""


def _operand(value: float, f: str) -> str:
    return f"({_word(value, f)})" if value < 0 else _word(value, f)


def _taking_memory(made: Compensation, n: str) -> str:
    return f", {n}_memory *memory" if made.program.remembered else ""


def _declared_memory(made: Compensation, n: str) -> str:
    if not made.program.remembered:
        return ""
    names = "".join(f"    {n}_real {name};\n" for name in made.program.remembered)
    return f"""/* Remembered from one sample to the next; before the first all is 0: {n}_memory memory = {{0}}; */
typedef struct {{
{names}}} {n}_memory;

"""


def _remembered(made: Compensation, n: str, f: str) -> str:
    """The stored values for the next sample."""
    program = made.program
    if not program.remembered:
        return ""
    sought = "".join(
        f"        const {n}_real {name} = out.{name};\n" for name in program.sought if _is_used(name, made)
    )
    lines = "".join(_line(line, n, f, "        ") for line in program.after)
    kept = "".join(f"        memory->{name} = {_word(word, f)};\n" for name, word in program.remembered.items())
    return f"    {{\n{sought}{lines}{kept}    }}\n"


def _is_used(name: str, made: Compensation) -> bool:
    """Whether stored values depend on it: compilers warn of unused variables."""
    program = made.program
    return any(name in line.inner for line in program.after) or name in program.remembered.values()


def _declared_in_gravity(made: Compensation, n: str) -> str:
    if made.costs.out_of_gravity is None:
        return ""
    return f"""
/* Where nothing but gravity acts: in->az is not looked at; side is 1 where the z axis points up, else -1. */
{n}_output {n}_in_gravity(const {n}_input *in, {n}_real side{_taking_memory(made, n)});
"""


def _in_gravity(made: Compensation, n: str, f: str) -> str:
    if made.costs.out_of_gravity is None:
        return ""
    anew, given, last = "", "", ""
    if made.program.remembered:  # each pass begins with what was remembered before the sample
        anew, given, last = f"    {n}_memory then = *memory;\n", ", &then", "    *memory = then;\n"
    again = "        then = *memory;\n" if given else ""
    return f"""
{n}_output {n}_in_gravity(const {n}_input *in, {n}_real side{_taking_memory(made, n)})
{{
    {n}_input with = *in;
{anew}    {n}_output out;
    int pass;

    with.az = 0;
    out = {n}_compensate(&with{given});
    for (pass = 0; pass < {PASSES}; ++pass) {{
        const {n}_real left = 1 - out.ax * out.ax - out.ay * out.ay;
        with.az = left > 0 ? side * sqrt{f}(left) : 0;
{again}        out = {n}_compensate(&with{given});
    }}
{last}    return out;
}}
"""


def _self_test(made: Compensation, n: str, checks: ReferenceVectors) -> str:
    f, program = SUFFIX[made.precision], made.program
    zeros = ", ".join(["0"] * len(program.remembered))
    memory, given = (f"    {n}_memory memory = {{{zeros}}};\n", ", &memory") if program.remembered else ("", "")
    rows = zip(checks.inputs.tolist(), checks.expected.tolist(), strict=True)
    table = "".join(
        f"    {{{{{', '.join(_word(x, f) for x in given)}}}, {{{', '.join(_word(x, f) for x in true)}}}}},\n"
        for given, true in rows
    )
    close = " && ".join(
        f"fabs{f}(out.{name} - vectors[k].out.{name}) <= {_word(checks.tolerance, f)}" for name in program.sought
    )
    return f"""#include "{n}.h"

#include <math.h>

/* Inputs that the model makes of true values, and the true values; within {checks.tolerance:g} {made.unit}. */
static const struct {{
    {n}_input in;
    {n}_output out;
}} vectors[] = {{
{table}}};

int {n}_self_test(void)
{{
{memory}    int failed = 0;
    unsigned k;

    for (k = 0; k < sizeof vectors / sizeof vectors[0]; ++k) {{
        const {n}_output out = {n}_compensate(&vectors[k].in{given});
        if (!({close})) {{
            ++failed;
        }}
    }}
    return failed;
}}

#ifdef {n.upper()}_MAIN
#include <stdio.h>

int main(void)
{{
    const int failed = {n}_self_test();
    printf("%d of %u reference vectors fail\\n", failed, (unsigned)(sizeof vectors / sizeof vectors[0]));
    return failed != 0;
}}
#endif
"""


def _line(line: Line, n: str, f: str, indent: str) -> str:
    words = [_word(inner, f) for inner in line.inner]
    return f"{indent}const {n}_real {line.name} = {OPERATIONS[line.operation].c.format(*words, f=f)};\n"


def _word(word: str | float, f: str) -> str:
    return word if isinstance(word, str) else f"{word!r}{f}"
