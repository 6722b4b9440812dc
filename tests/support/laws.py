"""All laws of a component by name, on floats and in its graph; and effects that are neutral."""

from __future__ import annotations

from functools import cache

import numpy as np

from fmus.kit.symbolic.tracing import trace


def named(cls, values):
    """Rates, outputs and next sampled values by name."""
    model = cls()
    for name, value in values.items():
        setattr(model, name, value)
    layout = cls.layout
    try:
        rates, outputs = model.rates(), model.outputs()
    except RecursionError:
        raise AssertionError(
            f"{cls.__name__}: laws call each other in a circle: a law that another effect makes"
            " call this one cannot be called in it; an input or a state can"
        ) from None
    result = dict(zip((f"der({s.name})" for s in layout.states), rates, strict=True))
    result |= dict(zip((o.name for o in layout.outputs), outputs, strict=True))
    return result | {d.name: getattr(model, d.update)() for d in layout.discretes}


@cache
def _graph(cls):
    """The graph of a component, and its functions by name."""
    graph = trace(cls)
    return graph, {f.name(): f for f in graph.functions(tangent=False)}


def in_graph(cls, values, time=0.0):
    """Rates, outputs and next sampled values by name, as `named` has them, by the graph."""
    graph, functions = _graph(cls)
    point = graph.point(**values)
    layout = cls.layout

    def of(function, names):
        return dict(zip(names, functions[function](time, *point).full().ravel(), strict=True))

    result = of("rates", [f"der({s.name})" for s in layout.states])
    result |= of("outputs", [o.name for o in layout.outputs])
    discretes = [d.name for d in layout.discretes]
    for i, (_, members) in enumerate(layout.sampled):
        after = of(f"update_{i}", discretes)
        result |= {d.name: after[d.name] for d in members}
    return result


def check_neutral(base, cls, values, laws=named):
    """Fail unless a component with effects has the bits of its base at their neutral values.

    Parameters
    ----------
    base, cls : type[Component]
        The component, and the same with effects.
    values : Mapping of str to float or ndarray
        Of the variables of `cls`.
    laws : callable
        `named` or `in_graph`.
    """
    known = {v.name for v in base.layout.variables}
    expected = laws(base, {name: value for name, value in values.items() if name in known})
    found = laws(cls, values)
    assert expected
    for name, value in expected.items():
        assert np.array_equal(found[name], value), name
