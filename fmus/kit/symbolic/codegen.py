"""C sources of one component: tables of its variables, and its laws from the CasADi graph.

The tables are ``model.h`` and ``tables.h``, the laws ``laws.c``. The beginning of ``fmi/engine.h``
specifies the contents of each file.
"""

from __future__ import annotations

import math
import os
import re
import string
from collections.abc import Mapping, Sequence

import casadi as ca

from fmus.kit.declare import (
    DiscreteDeclaration,
    InputDeclaration,
    OutputDeclaration,
    ParameterDeclaration,
    StateDeclaration,
)
from fmus.kit.interrupt import uninterrupted
from fmus.kit.layout import LONGEST_SHIFT, Clock, Layout
from fmus.kit.storage import scratch
from fmus.kit.symbolic.tracing import Graph

_PLAIN = {*string.ascii_letters, *string.digits, *" _-+*/^.,:;()[]{}<>="}  # in a literal of C
_ROLES = {
    ParameterDeclaration: "ROLE_PARAMETER",
    InputDeclaration: "ROLE_INPUT",
    StateDeclaration: "ROLE_STATE",
    DiscreteDeclaration: "ROLE_DISCRETE",
    OutputDeclaration: "ROLE_OUTPUT",
}

# CasADi writes unused functions with unused arguments
_LAWS = """\
#define CASADI_SYMBOL_EXPORT static inline
#ifdef __GNUC__
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
{}
#ifdef __GNUC__
#pragma GCC diagnostic pop
#endif
"""

# start of CasADi's definition of a helper such as casadi_sq
_HELPER = re.compile(r"^(?=(?:const )?\w+\*? casadi_\w+\()", re.M)

# CasADi's checks for missing arrays of operands and of results
_OPERAND = re.compile(r"arg\[(\d+)\]\? (arg\[\1\]\[\d+\]) : 0")
_RESULT = re.compile(r"if \((res\[\d+\])!=0\) (?=\1)")


def c_double(value: float) -> str:
    """Write a number in C.

    Parameters
    ----------
    value : float

    Returns
    -------
    str
    """
    if math.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))


def _c_bool(value: bool) -> str:
    """Write a boolean in C."""
    return "true" if value else "false"


def c_string(text: str) -> str:
    """Write a string literal in C: in UTF-8, with escapes by three octal digits.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
    """
    characters = (chr(b) if chr(b) in _PLAIN else f"\\{b:03o}" for b in text.encode())
    return f'"{"".join(characters)}"'


def tables(graph: Graph, guid: str) -> dict[str, str]:
    """Write the tables that the front-end reads.

    Parameters
    ----------
    graph : Graph
        The traced component.
    guid : str

    Returns
    -------
    dict of str to str
        ``model.h`` without the sizes of the laws, and ``tables.h``.
    """
    layout = graph.layout
    sizes = {
        "PARAMETERS": layout.parameters,
        "INPUTS": layout.inputs,
        "STATES": layout.states,
        "DISCRETES": layout.discretes,
        "OUTPUTS": layout.outputs,
        "GROUPS": layout.sampled,
        "TEXTS": layout.texts,
    }
    header = [
        "#ifndef MODEL_H",
        "#define MODEL_H",
        *(f"#define MODEL_{name} {len(group)}" for name, group in sizes.items()),
    ]
    arrays = [f" X({c_string(a.name)}, {a.first}, {a.size})" for a in layout.arrays]
    header += [f"#define MODEL_ARRAYS(X){''.join(arrays)}"] if arrays else []
    texts = [f"    {{{c_string(t.name)}, {c_string(t.start)}}}," for t in layout.texts]
    # C has no empty arrays
    body = [
        f"static const char model_name[] = {c_string(graph.name)};",
        f"static const char model_guid[] = {c_string(guid)};",
        f"static const double model_tolerance = {c_double(graph.tolerance)};",
        *variable_tables(layout, "model"),
        "static const Text model_texts[] = {",
        *(texts or ['    {"", ""},']),
        "};",
        f"static const bool model_restorable = {_c_bool(graph.restorable)};",
    ]
    return {"model.h": "\n".join(header) + "\n", "tables.h": "\n".join(body) + "\n"}


def variable_tables(layout: Layout, prefix: str) -> list[str]:
    """Write the tables of variables, start parameters and groups, whose names have a prefix.

    Parameters
    ----------
    layout : Layout
    prefix : str

    Returns
    -------
    list of str
        Lines of C.
    """
    index = layout.parameter_index
    starts = [index[layout.start_of[s.name]] for s in (*layout.states, *layout.discretes)]
    clocks = [f"    {_clock(clock, index)}," for clock, _ in layout.sampled]
    # C has no empty arrays
    return [
        f"static const Variable {prefix}_variables[] = {{",
        *_variable_rows(layout),
        "};",
        f"static const int {prefix}_start_of[] = {{{', '.join(map(str, starts or [0]))}}};",
        f"static const Group {prefix}_groups[] = {{",
        *(clocks or ["    {0.0, -1, {-1, -1}},"]),
        "};",
    ]


def _variable_rows(layout: Layout) -> list[str]:
    """Write a row of the table of variables for each variable and each derivative."""
    rows = []
    for v in layout.variables:
        start = float(getattr(v, "start", 0.0))
        numbers = ", ".join(map(c_double, (start, v.min, v.max, v.nominal)))
        rows.append(
            f"    {{{c_string(v.name)}, {c_string(v.unit)}, {_ROLES[type(v)]},"
            f" TYPE_{v.type.upper()}, {numbers}, {_c_bool(getattr(v, 'tunable', False))}}},"
        )
    for (name, unit), state in zip(layout.derivatives, layout.states, strict=True):
        numbers = f"0.0, -INFINITY, INFINITY, {c_double(state.nominal)}"
        rows.append(
            f"    {{{c_string(name)}, {c_string(unit)}, ROLE_DERIVATIVE, TYPE_REAL, {numbers},"
            " false},"
        )
    return rows


def _clock(clock: Clock, index: Mapping[str, int]) -> str:
    """Write a clock: period in s, or index of its parameter, and indices for the shift, or -1."""
    if isinstance(clock.period, str):
        period = f"0.0, {index[clock.period]}"
    else:
        period = f"{c_double(clock.period)}, -1"
    shifts = ([index[name] for name in clock.shift] + [-1] * LONGEST_SHIFT)[:LONGEST_SHIFT]
    return f"{{{period}, {{{', '.join(map(str, shifts))}}}}}"


@uninterrupted()
def native_sources(graph: Graph, guid: str, hosted: bool = True, fmi: int = 2) -> dict[str, str]:
    """Write every generated file of the native build.

    Parameters
    ----------
    graph : Graph
        The traced component.
    guid : str
    hosted : bool
        Whether the sources are for an FMU, with directional derivatives and event indicators.
        Without these, and without checks for missing arrays, they compile faster.
    fmi : {2, 3}
        Version of FMI of such an FMU.

    Returns
    -------
    dict of str to str
        ``model.h``, ``tables.h`` and ``laws.c``.
    """
    functions = graph.functions(hosted)
    if hosted:
        functions.append(ca.Function("indicators", graph.arguments, ca.cse([graph.indicators])))
    if fmi == 3:
        functions += graph.functions_of_fmi_3()
    files = tables(graph, guid)
    updates = "".join(f" X(update_{i})" for i in range(len(graph.updates)))
    if hosted:
        files["model.h"] += f"#define MODEL_INDICATORS {graph.indicators.numel()}\n"
    lines = [
        *(f"#define LAWS_SZ_{k} {n}" for k, n in work_sizes(functions).items()),
        f"#define LAWS_UPDATES(X){updates}",
        "#endif",
    ]
    files["model.h"] += "\n".join(lines) + "\n"
    files["laws.c"] = laws(functions, checked=hosted)
    return files


def work_sizes(functions: Sequence[ca.Function]) -> dict[str, int]:
    """Return the sizes of the work arrays that any of some functions needs.

    Parameters
    ----------
    functions : sequence of casadi.Function

    Returns
    -------
    dict of str to int
        Of arguments, results, integers and numbers: ``ARG``, ``RES``, ``IW`` and ``W``.
    """
    return {
        "ARG": max(f.sz_arg() for f in functions),
        "RES": max(f.sz_res() for f in functions),
        "IW": max(1, *(f.sz_iw() for f in functions)),
        "W": max(1, *(f.sz_w() for f in functions)),
    }


def laws(functions: list[ca.Function], checked: bool) -> str:
    """Write functions in C.

    Parameters
    ----------
    functions : list of casadi.Function
    checked : bool
        Whether arrays may be missing, which whoever passes all of them need not pay for.

    Returns
    -------
    str
    """
    text = _generate(functions)
    return _LAWS.format(text if checked else _RESULT.sub("", _OPERAND.sub(r"\2", text)))


def lawless_sources(graph: Graph, guid: str) -> dict[str, str]:
    """Write every generated file of a build whose laws are in Python, or that has none.

    Parameters
    ----------
    graph : Graph
        The traced component.
    guid : str

    Returns
    -------
    dict of str to str
        ``model.h`` and ``tables.h``.
    """
    files = tables(graph, guid)
    # the include guard is open for sizes of laws
    files["model.h"] += "#define MODEL_INDICATORS 0\n#endif\n"
    return files


def _generate(functions: list[ca.Function]) -> str:
    """Write functions in C, and check that CasADi wrote the whole file."""
    generator = ca.CodeGenerator("laws.c", {"with_header": False})
    for function in functions:
        generator.add(function)
    with scratch.folder("laws") as folder:
        generator.generate(f"{folder}{os.sep}")
        with scratch.written(folder):
            text = (folder / "laws.c").read_text(encoding="utf-8")
            # on a full disk CasADi writes only a part, and reports no error
            if generator.dump() not in text:
                scratch.check_room(folder)
                raise OSError("only a part of the laws was written")
            return _HELPER.sub("static inline ", text)
