"""The compensation as C99: a header, a source, and a self-test. No allocation, no state, one loop of fixed length."""

from __future__ import annotations

from calibrations.compensation.about import Origin, lines, unit_of_input
from calibrations.compensation.cost import PASSES
from calibrations.compensation.inverse import Compensation
from calibrations.compensation.operations import OPERATIONS
from calibrations.compensation.program import Line
from calibrations.compensation.vectors import Vectors

SUFFIX = {"double": "", "float": "f"}


def files(made: Compensation, origin: Origin, checks: Vectors) -> dict[str, str]:
    """The three files by name."""
    n = origin.name
    return {
        f"{n}.h": _header(made, origin),
        f"{n}.c": _source(made, n),
        f"{n}_self_test.c": _self_test(made, n, checks),
    }


def _header(made: Compensation, origin: Origin) -> str:
    n, program = origin.name, made.program
    about = "\n".join(f" * {line}".rstrip() for line in lines(made, origin)).replace("*/", "* /").replace("/*", "/ *")
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

{n}_output {n}_compensate(const {n}_input *in);
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
    begin = "".join(f"    out.{name} = 0;\n" for name in program.sought)
    sought = "".join(f"        const {n}_real {name} = out.{name};\n" for name in program.sought)
    end = "".join(f"        out.{a} = {_word(b, f)};\n" for a, b in zip(program.sought, program.next, strict=True))
    return f"""#include "{n}.h"

#include <math.h>

{n}_output {n}_compensate(const {n}_input *in)
{{
{taken}{before}    {n}_output out;
    int step;

{begin}    for (step = 0; step < {program.steps}; ++step) {{
{sought}{loop}{end}    }}
    return out;
}}
{_in_gravity(made, n, f)}"""


def _declared_in_gravity(made: Compensation, n: str) -> str:
    if made.costs.out_of_gravity is None:
        return ""
    return f"""
/* Where nothing but gravity acts: in->az is not looked at; side is 1 where the z axis points up, else -1. */
{n}_output {n}_in_gravity(const {n}_input *in, {n}_real side);
"""


def _in_gravity(made: Compensation, n: str, f: str) -> str:
    if made.costs.out_of_gravity is None:
        return ""
    return f"""
{n}_output {n}_in_gravity(const {n}_input *in, {n}_real side)
{{
    {n}_input with = *in;
    {n}_output out;
    int pass;

    with.az = 0;
    out = {n}_compensate(&with);
    for (pass = 0; pass < {PASSES}; ++pass) {{
        const {n}_real left = 1 - out.ax * out.ax - out.ay * out.ay;
        with.az = left > 0 ? side * sqrt{f}(left) : 0;
        out = {n}_compensate(&with);
    }}
    return out;
}}
"""


def _self_test(made: Compensation, n: str, checks: Vectors) -> str:
    f, program = SUFFIX[made.precision], made.program
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
    int failed = 0;
    unsigned k;

    for (k = 0; k < sizeof vectors / sizeof vectors[0]; ++k) {{
        const {n}_output out = {n}_compensate(&vectors[k].in);
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
