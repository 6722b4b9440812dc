"""Claims: an FMU is connected to corrections behind it and ahead of it, with fitted values."""

from __future__ import annotations

from types import SimpleNamespace

from fmus.kit import stack
from fmus.kit.law_terms import LawTerm, law_term_effect
from orchestration.diagnosis.foreign.component import Fitted, Names, output_correction
from orchestration.diagnosis.foreign.diagnosis import FmuDiagnosis
from orchestration.diagnosis.foreign.response import FmuResponse
from orchestration.diagnosis.foreign.system import corrected_system
from orchestration.system import Connection, Port
from tests.support.lag import STEP

EXPERIMENT = (200.0, STEP)


def corrected(lag, law, signal, settings=None):
    """The system of a lag, of which a law has a linear term of 0.3 of a signal."""
    names = Names.of(lag, ["tau"])
    fit = {"tau": Fitted(1.0, 1.0)}
    response = FmuResponse(*([[-1.0]], [1.0], [1.0]), 0.0, 100.0)
    base = output_correction(
        lag, names, ["u"], ["x"], EXPERIMENT, fit=fit, responses={("x", "u"): response}
    )
    term = LawTerm(law, signal, "linear", "none", "added", "1", "1", power=1.0)
    component = stack(base, law_term_effect(base, law, term), defaults={"added": 0.3, "tau": 0.9})
    found = SimpleNamespace(component=component)
    known = {"tau": 0.9, **(settings or {})}
    return corrected_system(FmuDiagnosis(found, lag, known, names, ["x"], ["u"], EXPERIMENT))


def values(system, member):
    return {p.name: p.start for p in system.member(member).cls.layout.parameters}


def test_a_correction_of_an_output_stands_behind_the_fmu(lag):
    system = corrected(lag, "x", "u")
    assert [member.name for member in system.members] == ["fmu", "correction"]
    assert system.member("fmu").parameters == {"tau": 0.9}
    assert values(system, "correction") == {"added": 0.3}
    assert system.connections == (Connection(Port("fmu", "x"), Port("correction", "x_simulated")),)
    assert set(system.inputs["u"]) == {Port("fmu", "u"), Port("correction", "u")}


def test_a_correction_of_an_input_stands_ahead_of_it(lag):
    system = corrected(lag, "u_in_fmu", "u")
    assert values(system, "feed") == {"added": 0.3}
    assert Connection(Port("feed", "u_in_fmu"), Port("fmu", "u")) in system.connections
    assert set(system.inputs["u"]) == {Port("correction", "u"), Port("feed", "u")}


def test_what_it_gets_over_what_it_gives_closes_a_loop(lag):
    system = corrected(lag, "u_in_fmu", "x_simulated")
    assert Connection(Port("fmu", "x"), Port("feed", "x_simulated")) in system.connections


def test_an_input_with_a_given_value_keeps_it(lag):
    system = corrected(lag, "x", "x_simulated", {"u": 0.7})
    assert system.member("fmu").parameters == {"tau": 0.9, "u": 0.7}
    assert "u" not in system.inputs
