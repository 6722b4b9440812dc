"""C source of one component: its tables (``model.h``, ``tables.h``) and its laws (``laws.c``, from the CasADi graph).

What each file must contain is written at the top of ``fmi2/engine.h``.
"""

from __future__ import annotations

import json
import math
import os
import re

import casadi as ca

from fmus.kit.declare import (
    DiscreteDeclaration,
    InputDeclaration,
    OutputDeclaration,
    ParameterDeclaration,
    StateDeclaration,
)
from fmus.kit.storage import scratch
from fmus.kit.symbolic.trace import Graph

_ROLES = {
    ParameterDeclaration: "ROLE_PARAMETER",
    InputDeclaration: "ROLE_INPUT",
    StateDeclaration: "ROLE_STATE",
    DiscreteDeclaration: "ROLE_DISCRETE",
    OutputDeclaration: "ROLE_OUTPUT",
}

# CasADi writes functions that nobody calls, with arguments that nobody uses.
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

_HELPER = re.compile(
    r"^(?=(?:const )?\w+\*? casadi_\w+\()", re.M
)  # where CasADi defines one, such as casadi_sq


def _c_double(value: float) -> str:
    if math.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))


def _c_string(text: str) -> str:
    return json.dumps(text)  # the escapes of JSON are those of C for printable ASCII


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
    groups = layout.sampled
    sizes = {
        "PARAMETERS": layout.parameters,
        "INPUTS": layout.inputs,
        "STATES": layout.states,
        "DISCRETES": layout.discretes,
        "OUTPUTS": layout.outputs,
        "GROUPS": groups,
        "TEXTS": layout.texts,
    }
    header = [
        "#ifndef MODEL_H",
        "#define MODEL_H",
        *(f"#define MODEL_{k} {len(v)}" for k, v in sizes.items()),
    ]
    rows = []
    for v in layout.variables:
        start = _c_double(float(getattr(v, "start", 0.0)))
        numbers = ", ".join([start, *map(_c_double, (v.min, v.max, v.nominal))])
        rows.append(
            f"    {{{_c_string(v.name)}, {_c_string(v.unit)}, {_ROLES[type(v)]}, TYPE_{v.type.upper()}, {numbers}}},"
        )
    for (name, unit), state in zip(layout.derivatives, layout.states, strict=True):
        numbers = f"0.0, -INFINITY, INFINITY, {_c_double(state.nominal)}"
        rows.append(
            f"    {{{_c_string(name)}, {_c_string(unit)}, ROLE_DERIVATIVE, TYPE_REAL, {numbers}}},"
        )
    index = {p.name: i for i, p in enumerate(layout.parameters)}
    starts = [index[layout.start_of[s.name]] for s in (*layout.states, *layout.discretes)]
    periods = [
        f"    {{0.0, {index[period]}}},"
        if isinstance(period, str)
        else f"    {{{_c_double(period)}, -1}},"
        for period, _ in groups
    ]
    texts = [f"    {{{_c_string(t.name)}, {_c_string(t.start)}}}," for t in layout.texts]
    body = [
        f"static const char model_name[] = {_c_string(graph.name)};",
        f"static const char model_guid[] = {_c_string(guid)};",
        f"static const double model_tolerance = {_c_double(graph.tolerance)};",
        "static const Variable model_variables[] = {",
        *rows,
        "};",
        f"static const int model_start_of[] = {{{', '.join(map(str, starts or [0]))}}};",
        "static const Group model_groups[] = {",
        *(periods or ["    {0.0, -1},"]),
        "};",
        "static const Text model_texts[] = {",
        *(texts or ['    {"", ""},']),
        "};",
        f"static const bool model_restorable = {'true' if graph.restorable else 'false'};",
    ]
    return {"model.h": "\n".join(header) + "\n", "tables.h": "\n".join(body) + "\n"}


def native_sources(graph: Graph, guid: str, hosted: bool = True) -> dict[str, str]:
    """Write every generated file of the native build.

    Parameters
    ----------
    graph : Graph
        The traced component.
    guid : str
    hosted : bool
        Whether there will be an FMU, whose host may ask for directional derivatives and event indicators.

    Returns
    -------
    dict of str to str
        ``model.h``, ``tables.h`` and ``laws.c``.
    """
    functions = graph.functions(hosted)
    if hosted:
        functions.append(ca.Function("indicators", graph.arguments, ca.cse([graph.indicators])))
    sizes = {
        "ARG": max(f.sz_arg() for f in functions),
        "RES": max(f.sz_res() for f in functions),
        "IW": max(1, *(f.sz_iw() for f in functions)),
        "W": max(1, *(f.sz_w() for f in functions)),
    }
    files = tables(graph, guid)
    updates = "".join(f" X(update_{i})" for i in range(len(graph.updates)))
    if hosted:
        files["model.h"] += f"#define MODEL_INDICATORS {graph.indicators.numel()}\n"
    lines = [
        *(f"#define LAWS_SZ_{k} {n}" for k, n in sizes.items()),
        f"#define LAWS_UPDATES(X){updates}",
        "#endif",
    ]
    files["model.h"] += "\n".join(lines) + "\n"
    files["laws.c"] = _LAWS.format(_generate(functions))
    return files


def lawless_sources(graph: Graph, guid: str) -> dict[str, str]:
    """Write every generated file of a build without laws in C: they stay in Python, or there are none.

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
    files["model.h"] += "#endif\n"
    return files


def _generate(functions: list[ca.Function]) -> str:
    generator = ca.CodeGenerator("laws.c", {"with_header": False})
    for function in functions:
        generator.add(function)
    with scratch.folder("laws") as folder:
        generator.generate(f"{folder}{os.sep}")
        with scratch.written(folder):
            text = (folder / "laws.c").read_text(encoding="utf-8")
            if (
                generator.dump() not in text
            ):  # where there is no room CasADi writes a part, and says nothing
                scratch.check_room(folder)
                raise OSError("of the laws, a part was written")
            return _HELPER.sub("static inline ", text)
