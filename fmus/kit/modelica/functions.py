"""Modelica functions that equations call.

A function has no events (specification 3.6, section 8.5): the output of a converter steps at every
count of its signal, where no solver should stop.
"""

from __future__ import annotations

_ROUNDED = """\
function {name} "{comment}, without an event where it steps"
  input Real x;
  output Real y;
algorithm
  y := {rounded}(x);
end {name};
"""
_HYPOTENUSE = """\
function hypotenuse "Square root of the sum of the squares, without overflow on the way"
  input Real a;
  input Real b;
  output Real c;
protected
  Real larger;
  Real share;
algorithm
  larger := max(abs(a), abs(b));
  share := min(abs(a), abs(b)) / max(larger, 1e-300);
  c := larger * sqrt(1.0 + share * share);
end hypotenuse;
"""


def function_classes() -> dict[str, str]:
    """Write the classes of all functions.

    Returns
    -------
    dict of str to str
        Text of each class by its name, without the ``within`` clause.
    """
    down = _ROUNDED.format(
        name="roundedDown", comment="Largest integer not above x", rounded="floor"
    )
    up = _ROUNDED.format(name="roundedUp", comment="Smallest integer not below x", rounded="ceil")
    return {"hypotenuse": _HYPOTENUSE, "roundedDown": down, "roundedUp": up}
