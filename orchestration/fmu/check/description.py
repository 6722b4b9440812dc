"""Checks of ``modelDescription.xml``: structure, units, descriptions, ranges, and capabilities."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Set
from xml.etree.ElementTree import Element

from fmus.kit import UserError
from fmus.kit.units import BASES
from orchestration.fmu.archive import Archive, experiment_faults
from orchestration.fmu.check.finding import Finding, listed

_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")
_NAMES_IN_FMI_3 = {
    "Outputs": "Output",
    "Derivatives": "ContinuousStateDerivative",
    "InitialUnknowns": "InitialUnknown",
    "canGetAndSetFMUstate": "canGetAndSetFMUState",
    "canSerializeFMUstate": "canSerializeFMUState",
    "providesDirectionalDerivative": "providesDirectionalDerivatives",
}


def check_description(archive: Archive) -> Iterator[Finding]:
    """Check the model description, after its translation to FMI 2.0 if it is of FMI 3.0.

    Yields
    ------
    Finding
    """
    for problem in _fmpy_problems(archive):
        yield Finding("model-description", problem, _variables_in(problem, archive.description))
    try:
        root = archive.as_fmi2
    except UserError as error:
        yield Finding("model-description", str(error).removeprefix(f"{archive.path}: "))
        return
    original_names = _NAMES_IN_FMI_3 if archive.version == 3 else {}
    yield from _check_structure(root, original_names)
    yield from _check_units(root)
    yield from _check_descriptions(root)
    yield from _check_ranges(root)
    yield from _check_capabilities(root, original_names)
    if archive.version == 3:
        yield from _report_ignored_parts(archive.description)
        if [node.tag for node in archive.interfaces()] == ["ScheduledExecution"]:
            yield Finding(
                "scheduled-execution", "for scheduled execution alone: run here as co-simulation"
            )
        if archive.idle_clocks:
            names = listed(archive.idle_clocks)
            yield Finding(
                "idle-clock",
                f"clocks that nothing triggers here never tick: {names}",
                archive.idle_clocks,
            )


def _fmpy_problems(archive: Archive) -> Iterator[str]:
    """Yield the problems that fmpy finds, without false ones about aliases."""
    from fmpy.validation import validate_fmu

    aliases = {node.get("name", "") for node in archive.description.iter("Alias")}
    for problem in validate_fmu(str(archive.path)):
        line = " ".join(str(problem).split())
        if line.isdecimal():  # the text of a KeyError
            line = f"ModelStructure: no variable has the value reference {line}"
        if not _concerns_aliases(line, aliases):
            yield line


def _concerns_aliases(problem: str, aliases: Set[str]) -> bool:
    """Return whether fmpy only misses aliases among the initial unknowns, where none belong."""
    sets = [set(names.split(", ")) for names in re.findall(r"{ ?(.*?) ?}", problem)]
    if "InitialUnknowns" not in problem or len(sets) != 2:
        return False
    expected, actual = sets
    return expected - aliases == actual


def _variables_in(problem: str, root: Element) -> list[str]:
    """Return the variables of an FMU that a message of fmpy names."""
    words = set(re.split(r"[\s\"',{}]+", problem))
    names = [node.get("name", "") for node in root.iterfind("ModelVariables/*")]
    return [name for name in names if name in words]


def _report_ignored_parts(root: Element) -> Iterator[Finding]:
    """Report the parts of an FMU of FMI 3.0 that this program ignores."""
    variables = root.findall("ModelVariables/*")
    groups = {
        "binary-variable": ("Binary", "binary variables are hexadecimal texts here"),
        "structural-parameter": (
            "structuralParameter",
            "structural parameters keep their start values here",
        ),
    }
    for code, (kind, remark) in groups.items():
        names = [
            node.get("name", "") for node in variables if kind in (node.tag, node.get("causality"))
        ]
        if names:
            yield Finding(code, f"{remark}: {listed(names)}", names)


def _variables(root: Element) -> Iterator[tuple[Element, Element, dict[str, str]]]:
    """Yield every variable, its type element, and that element's attributes.

    Attributes of the declared type are included unless the variable has its own.
    """
    declared_attributes = {
        node.get("name", ""): dict(node[0].attrib)
        for node in root.iterfind("TypeDefinitions/SimpleType")
        if len(node)
    }
    for variable in root.iterfind("ModelVariables/ScalarVariable"):
        node = next((child for child in variable if child.tag in _TYPES), None)
        if node is not None:
            declared = declared_attributes.get(node.get("declaredType", ""), {})
            yield variable, node, declared | dict(node.attrib)


def _check_structure(root: Element, original_names: Mapping[str, str]) -> Iterator[Finding]:
    """Report unknowns of the model structure without declared dependencies."""
    names = [
        variable.get("name", "") for variable in root.iterfind("ModelVariables/ScalarVariable")
    ]
    for section in ("Outputs", "Derivatives", "InitialUnknowns"):
        without_dependencies = [
            _name_of(unknown, names)
            for unknown in root.iterfind(f"ModelStructure/{section}/Unknown")
            if unknown.get("dependencies") is None
        ]
        if without_dependencies:
            yield Finding(
                "no-dependencies",
                f"ModelStructure/{original_names.get(section, section)}: no dependencies, so hosts"
                f" must assume all, for {listed(without_dependencies)}",
                without_dependencies,
            )


def _name_of(unknown: Element, names: list[str]) -> str:
    """Return the name of the variable that an element ``Unknown`` refers to by its index."""
    index = unknown.get("index", "")
    exists = index.isdecimal() and 1 <= int(index) <= len(names)
    return names[int(index) - 1] if exists else f"(index {index})"


# --- units


def _check_units(root: Element) -> Iterator[Finding]:
    """Check unit definitions, and report real variables without a unit."""
    units = list(root.iterfind("UnitDefinitions/Unit"))
    without_unit = [
        variable.get("name", "")
        for variable, node, attributes in _variables(root)
        if node.tag == "Real" and not attributes.get("unit") and not _is_time(variable)
    ]
    if not units:
        yield Finding("no-unit-definitions", "there are no UnitDefinitions")
    if without_unit:
        yield Finding("no-unit", f"no unit for {listed(without_unit)}", without_unit)
    for unit in units:
        yield from _check_unit(unit)


def _is_time(variable: Element) -> bool:
    """Return whether a variable is the independent one, which FMI 3.0 requires in every FMU."""
    return variable.get("causality") == "independent"


def _check_unit(unit: Element) -> Iterator[Finding]:
    """Check the base units and the conversions of a unit."""
    name = unit.get("name", "")
    base = unit.find("BaseUnit")
    if base is None:
        yield Finding("no-base-unit", f"unit {name!r} has no BaseUnit: hosts cannot convert it")
        return
    for attribute in BASES:
        if not re.fullmatch(r"\s*[+-]?\d+\s*", base.get(attribute, "0")):
            yield Finding(
                "base-unit",
                f"unit {name!r}: exponent {attribute}={base.get(attribute)!r}, expected an integer",
            )
    yield from _check_conversion(base, f"unit {name!r}")
    for display in unit.iterfind("DisplayUnit"):
        yield from _check_conversion(
            display, f"display unit {display.get('name', '')!r} of {name!r}"
        )


def _check_conversion(node: Element, label: str) -> Iterator[Finding]:
    """Check the factor and the offset of a unit, named `label` in messages."""
    factor = _number(node, "factor", 1.0)
    offset = _number(node, "offset", 0.0)
    if factor is None or factor == 0.0 or not math.isfinite(factor):
        yield Finding(
            "unit-factor",
            f"{label}: factor={node.get('factor')!r}, expected a finite number other than 0",
        )
    if offset is None or not math.isfinite(offset):
        yield Finding(
            "unit-offset", f"{label}: offset={node.get('offset')!r}, expected a finite number"
        )


def _number(
    node: Element | Mapping[str, str], attribute: str, default: float | None = None
) -> float | None:
    """Return the value of an attribute, or `default` if it is missing; None if it is no number."""
    text = node.get(attribute)
    if text is None:
        return default
    try:
        return float({"INF": "inf", "-INF": "-inf"}.get(text.strip(), text))
    except ValueError:
        return None


# --- descriptions and ranges


def _check_descriptions(root: Element) -> Iterator[Finding]:
    """Report a model and variables without a description."""
    if not root.get("description", "").strip():
        yield Finding("no-model-description", "the model has no description")
    undescribed = [
        variable.get("name", "")
        for variable in root.iterfind("ModelVariables/ScalarVariable")
        if not variable.get("description", "").strip() and not _is_time(variable)
    ]
    if undescribed:
        yield Finding("no-description", f"no description for {listed(undescribed)}", undescribed)


def _check_ranges(root: Element) -> Iterator[Finding]:
    """Check ranges, start values and nominal values; report parameters without a range."""
    unlimited = []
    for variable, node, attributes in _variables(root):
        name = variable.get("name", "")
        low = _number(attributes, "min")
        high = _number(attributes, "max")
        nominal = _number(attributes, "nominal", 1.0)
        if low is not None and high is not None and low > high:
            yield Finding("range", f"{name}: min = {low:g} is above max = {high:g}", [name])
        elif node.tag != "Boolean":
            yield from _check_start_value(name, _number(attributes, "start"), low, high)
        if nominal is not None and not 0.0 < nominal < math.inf:
            yield Finding(
                "nominal", f"{name}: nominal = {nominal:g}, expected a positive number", [name]
            )
        is_number = node.tag in ("Real", "Integer")
        if variable.get("causality") == "parameter" and is_number and low is None and high is None:
            unlimited.append(name)
    if unlimited:
        yield Finding(
            "no-range", f"no range (min, max) for the parameters {listed(unlimited)}", unlimited
        )


def _check_start_value(
    name: str, start: float | None, low: float | None, high: float | None
) -> Iterator[Finding]:
    """Check that a start value is finite and within its range."""
    if start is None:
        return
    if not math.isfinite(start):
        yield Finding("start-value", f"{name}: start = {start} is not finite", [name])
    elif (low is not None and start < low) or (high is not None and start > high):
        lower = "-inf" if low is None else f"{low:g}"
        upper = "inf" if high is None else f"{high:g}"
        message = f"{name}: start = {start:g} is outside of its range, {lower} to {upper}"
        yield Finding("start-value", message, [name])


# --- capabilities


def _check_capabilities(root: Element, original_names: Mapping[str, str]) -> Iterator[Finding]:
    """Check the interface for co-simulation, or else for model exchange, and the experiment."""
    interface = root.find("CoSimulation")
    if interface is None:
        interface = root.find("ModelExchange")
        if interface is None:
            yield Finding("no-interface", "there is neither CoSimulation nor ModelExchange")
            return
        yield Finding("model-exchange-only", "for model exchange alone: its hosts need a solver")
    identifier = interface.get("modelIdentifier", "")
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", identifier):
        yield Finding("model-identifier", f"modelIdentifier {identifier!r} is no identifier of C")
    yield from _check_flags(interface, original_names)
    if root.find("LogCategories") is None:
        yield Finding(
            "no-log-categories", "no LogCategories are declared: hosts cannot choose messages"
        )
    for fault in experiment_faults(root):
        yield Finding("default-experiment", fault)
    if root.find("DefaultExperiment") is None:
        yield Finding(
            "no-default-experiment",
            "there is no DefaultExperiment: users must guess stop time and step size",
        )


def _check_flags(interface: Element, original_names: Mapping[str, str]) -> Iterator[Finding]:
    """Check the capability flags of an interface.

    Parameters
    ----------
    interface : Element
        Element ``CoSimulation`` or ``ModelExchange`` of FMI 2.0.
    original_names : Mapping of str to str
        Names of its attributes in the archive, if they differ.
    """

    def can(name: str) -> bool:
        return interface.get(name, "false").strip() in ("true", "1")

    for name in ("canGetAndSetFMUstate", "canSerializeFMUstate"):
        if not can(name):
            flag = original_names.get(name, name)
            yield Finding(
                "no-state", f"{flag} is false: hosts cannot repeat a step or store the state"
            )
    if can("canBeInstantiatedOnlyOncePerProcess"):
        yield Finding(
            "one-instance",
            "canBeInstantiatedOnlyOncePerProcess is true: no two instances in one process",
        )
    varies = can("canHandleVariableCommunicationStepSize") or interface.tag == "ModelExchange"
    if not varies:
        yield Finding(
            "fixed-step",
            "canHandleVariableCommunicationStepSize is false: steps must be of one size",
        )
    name = "providesDirectionalDerivative"
    if not can("needsExecutionTool") and not can(name):
        yield Finding("no-derivatives", f"{original_names.get(name, name)} is false")
