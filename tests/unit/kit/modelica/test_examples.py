"""Claims: an example has its members, what connects them, and sources of its inputs."""

import re

import pytest

import fmus
from fmus.kit import UserError, registry
from fmus.kit.modelica.examples import example_classes
from fmus.kit.registry import Example, MemberDeclaration, SystemDeclaration

CLAMPED = ("galvanostat", "ppy_actuator_length_driven")


def written(*names):
    return example_classes([*map(fmus.component, names)])


def pairs(text):
    return {frozenset(pair) for pair in re.findall(r"connect\((\S+), (\S+)\);", text)}


def test_it_is_written_if_the_package_has_its_members():
    assert list(written(*CLAMPED)) == ["ClampedActuator"]
    assert written("galvanostat") == {}


def test_members_are_connected_and_second_connectors_have_a_reference():
    text = written(*CLAMPED)["ClampedActuator"]
    assert pairs(text) == {
        frozenset(("galvanostat.p", "actuator.p")),
        frozenset(("actuator_length_change_source.c", "actuator.flange_b")),
        frozenset(("ground.c", "galvanostat.n")),
        frozenset(("ground.c", "actuator.n")),
        frozenset(("frame.c", "actuator.flange_a")),
    }
    for part in (
        'parameter Real current_command(unit="A") = 0.5 ',
        "current_command=current_command, voltage_limit=15.0",
        "PpyRig.Sources.Position actuator_length_change_source(value=length_change)",
        "annotation(experiment(StopTime=20.0, Interval=0.04, Tolerance=1e-08));",
    ):
        assert part in text, part


def test_members_with_effects_stand_beside_it():
    texts = written("foot_dynamic", "ppy_actuator_length_driven")
    assert list(texts) == ["TautFoot", "FootGait"]
    assert texts["TautFoot"].startswith("model TautFoot ")
    assert "PpyRig.Examples.TautFoot foot(" in texts["FootGait"]


@pytest.mark.parametrize(
    ("variable", "kind"), [("current", "Current"), ("length_change", "Position")]
)
def test_a_signal_that_sets_a_variable_of_a_port_has_a_source(variable, kind, monkeypatch):
    system = SystemDeclaration(
        name="loop",
        summary="A loop.",
        members={
            "pid": MemberDeclaration("pid"),
            "actuator": MemberDeclaration("ppy_actuator_length_driven"),
        },
        connections=(f"pid.command -> actuator.{variable}", "actuator.voltage -> pid.measured"),
        inputs={},
        outputs=(),
        step=0.1,
        stop=1.0,
    )
    monkeypatch.setattr(registry, "examples", lambda: [Example(system, {})])
    text = written("pid", "ppy_actuator_length_driven")["Loop"]
    source = f"actuator_{variable}_source"
    assert f"PpyRig.Sources.{kind} {source}(value=pid.command)" in text
    first = {"current": "p", "length_change": "flange_b"}[variable]
    assert frozenset((f"{source}.c", f"actuator.{first}")) in pairs(text)
    assert frozenset(("actuator.voltage", "pid.measured")) in pairs(text)


@pytest.mark.parametrize(
    ("target", "message"),
    [
        (
            "actuator.curent",
            r"^loop: actuator has no variable named 'curent' \(did you mean current",
        ),
        ("film.current", r"^loop: no member named 'film'"),
        ("actuator.current", r"^loop: the example sets no input named 'drive'"),
    ],
)
def test_what_an_example_does_not_say_is_told(target, message, monkeypatch):
    members = {"actuator": MemberDeclaration("ppy_actuator")}
    system = SystemDeclaration("loop", "A loop.", members, (), {"drive": (target,)}, (), 0.1, 1.0)
    monkeypatch.setattr(registry, "examples", lambda: [Example(system, {})])
    with pytest.raises(UserError, match=message):
        written("ppy_actuator")
