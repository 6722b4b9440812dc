"""Claims: causes of a part are those of the member whose law they are of, with its verdict."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fmus.kit import Component, Effect, Input, Output, Parameter, State, UserError
from fmus.kit import Term as EffectTerm
from orchestration.diagnosis import Shape, Term
from orchestration.diagnosis.systems.diagnosis import (
    Judgement,
    MemberDiagnosis,
    SystemDiagnosis,
    diagnose_system,
    judgements,
)
from orchestration.diagnosis.systems.fused_component import fused
from orchestration.diagnosis.systems.parts import Cuts
from orchestration.diagnosis.systems.report import overview, reason, sentence, summary, view_of
from orchestration.diagnosis.terms import NamedTerm
from orchestration.identify.uncertainty import Estimate
from orchestration.records import Record, write_record
from orchestration.system import Member, Port, System, connect, ssp
from tests.support.reference import documented, fields
from tests.support.system.lags import lags

STEP = 0.05


class Tank(Component):
    """A tank that runs out through a hole."""

    name = "leaking_tank"
    area = Parameter(2.0, "m^2", min=0.01, max=100.0)
    hole = Parameter(0.5, "m^2/s", min=0.0, max=100.0)
    inflow = Input("m^3/s")
    height = State("m", rate="rising", nominal=0.5)

    def out(self) -> Any:
        """Through the hole."""
        return self.hole * self.height

    def rising(self) -> Any:
        """By what comes in."""
        return (self.inflow - self.out()) / self.area

    @Output("m")
    def level(self) -> Any:
        """As seen."""
        return self.height

    @Output("m^3/s")
    def outflow(self) -> Any:
        """To the next."""
        return self.out()


class Silting(Effect):
    """A hole that silts up with height; silt = 0 is without."""

    id = "silting"
    title = "A hole that silts up"
    neutral = "silt"
    term = EffectTerm("out", "height", "-s h^2", "out over height")
    silt = Parameter(0.0, "m/s", min=-10.0, max=10.0, nominal=0.2, doc="silt")

    def out(self) -> Any:
        """Less what the silt holds."""
        return super().out() - self.silt * self.height**2


EFFECTS = {"silting": Silting}


def levels(inflow: np.ndarray, silt: float) -> np.ndarray:
    """Return both levels (n, 2) of two tanks, of which the second silts, by many Euler steps."""
    first, second = 0.0, 0.0
    rows = []
    for now in inflow:
        rows.append([first, second])
        for _ in range(200):
            out = 0.5 * first
            first += STEP / 200.0 * (now - out) / 2.0
            second += STEP / 200.0 * (out - 0.5 * second + silt * second**2) / 2.0
    return np.array(rows)


def cuts_of(silt: float, measured: tuple[str, ...]) -> tuple[Cuts, Record]:
    """Return two tanks in a row, with what was measured of them."""
    system = System(
        "row",
        (Member.of("a", Tank), Member.of("b", Tank)),
        connect("a.outflow -> b.inflow"),
        {"inflow": (Port("a", "inflow"),)},
        {},
    )
    rng = np.random.default_rng(4)
    time = STEP * np.arange(1200)
    inflow = np.repeat(rng.uniform(0.0, 0.5, 40), 30)
    clean = levels(inflow, silt)
    a, b = (clean + 1e-3 * rng.standard_normal(clean.shape)).T
    signals = {
        Port("a", "inflow"): inflow,
        Port("a", "level"): a,
        Port("b", "level"): b,
        Port("a", "outflow"): 0.5 * clean[:, 0],
    }
    known = {port: v for port, v in signals.items() if str(port) in measured}
    return Cuts(system, known, {}), Record(time, {}, {}, Path("row.csv"))


ALL = ("a.inflow", "a.level", "a.outflow", "b.level")


@pytest.mark.slow
@pytest.mark.parametrize("measured", [ALL, ("a.inflow", "a.level", "b.level")])
@pytest.mark.parametrize("silt", [0.0, 0.2])
def test_the_member_that_silts_is_told_cut_and_closed(
    measured: tuple[str, ...], silt: float
) -> None:
    cuts, record = cuts_of(silt, measured)
    judged = judgements(cuts, record, lambda text: None, None)
    assert len(judged) == (2 if measured == ALL else 1)
    members = [
        MemberDiagnosis(name, "", "", next(j for j in judged if name in j.part.names))
        for name in "ab"
    ]
    found = SystemDiagnosis("row", record, members)
    assert [str(m.verdict) for m in members] == ["consistent", "wrong" if silt else "consistent"]
    assert [m.name for m in found.wrong] == (["b"] if silt else [])
    if silt:
        (name, cause), *_ = members[1].causes
        assert name == "silting" or name.startswith("out(")
        assert cause.probability > 0.9
        assert "silting" in reason(members[1]) or "out" in reason(members[1])
        assert sentence(found) == "The laws of b are wrong."
    overview(view_of(found))
    assert [m["member"] for m in summary(found)["members"]] == ["a", "b"]


def judgement(
    verdict: str, *causes: tuple[Term, float], changed: tuple[str, ...] = ()
) -> Judgement:
    """Return the judgement of two tanks as one component, of which a diagnosis says so much."""
    whole = fused("a_b", {"a": Tank, "b": Tank}, {}, connect("a.outflow -> b.inflow"))
    model = SimpleNamespace(parameters=whole.cls.layout.parameters, start_positions=[])
    diagnosis: Any = SimpleNamespace(
        verdict=verdict,
        is_named=verdict in ("cause", "ambiguous"),
        causes=[SimpleNamespace(parts=(term,), probability=p) for term, p in causes],
        changed=changed,
        parameters={
            name: Estimate(1.0, 0.5, (0.9, 1.1), "1") for name in ("a_hole", "b_hole", "b_silt")
        },
        found=SimpleNamespace(subject=SimpleNamespace(problem=SimpleNamespace(model=model))),
    )
    part: Any = SimpleNamespace(names=["a", "b"], inputs={})
    return Judgement(part, diagnosis, whole=whole)


def of_both(judged: Judgement) -> list[MemberDiagnosis]:
    return [MemberDiagnosis(name, "", "", judged) for name in "ab"]


def test_a_cause_is_of_the_member_whose_law_it_is() -> None:
    hole = Term("b_out", "a_height", Shape.LINEAR)
    silting = NamedTerm("a_out", "a_height", Shape.LINEAR, effect="a_silting", family="a_out")
    a, b = of_both(judgement("ambiguous", (hole, 0.6), (silting, 0.35), changed=("a_hole",)))
    assert [(name, c.probability) for name, c in b.causes] == [("out(a.height)", 0.6)]
    assert [name for name, _ in a.causes] == ["silting"]
    assert str(b.verdict) == "wrong"
    assert str(a.verdict) == "cannot be judged", "it may be this one instead"
    assert b.parameters.keys() == {"hole", "silt"}
    assert a.parameters["hole"].differs


def test_members_without_a_cause_have_the_verdict_of_their_parameters() -> None:
    hole = Term("b_out", "b_height", Shape.LINEAR)
    a, b = of_both(judgement("cause", (hole, 0.97), changed=("a_hole",)))
    assert (str(a.verdict), str(b.verdict)) == ("recalibrate", "wrong")
    a, b = of_both(judgement("consistent"))
    assert (str(a.verdict), str(b.verdict)) == ("consistent", "consistent")
    assert reason(a) == "nothing is left that noise cannot account for"


def test_a_part_that_nothing_explains_is_wrong() -> None:
    a, b = of_both(judgement("unexplained"))
    assert (str(a.verdict), str(b.verdict)) == ("wrong", "wrong")
    assert reason(b) == "something is missing, and nothing that was tried explains it"
    assert a.partners == ["b"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gain", "tau", "expected"),
    [
        (0.0, 1.0, ("consistent", "consistent")),
        (0.1, 1.0, ("consistent", "wrong")),
        (0.0, 1.4, ("recalibrate", "consistent")),
    ],
)
def test_members_without_equations_are_corrected_at_their_ports(
    tmp_path: Path, gain: float, tau: float, expected: tuple[str, str]
) -> None:
    """Of two lags the second is read by a sensor with a square, or the first is slower."""
    lags(tmp_path, gain, a=tau)
    found = diagnose_system(tmp_path / "record.csv", ssp.read(tmp_path / "system.ssp", tmp_path))
    a, b = found.members
    assert (str(a.verdict), str(b.verdict)) == expected
    fitted = a.parameters["tau"].estimate
    assert fitted.interval[0] < tau < fitted.interval[1]
    assert fitted.unit == "s"
    assert [m.name for m in found.wrong] == (["b"] if gain else [])
    assert list(b.outputs) == ["x"]
    columns = {str(port): column for port, (column, _) in found.columns.items()}
    assert columns == {"a.u": "drive", "a.x": "a.x", "b.x": "b.x"}
    figures = json.loads(json.dumps(summary(found), allow_nan=False))
    if gain:
        (cause,) = figures["members"][1]["group"][:1]
        assert cause["probability"] > 0.8
        written = {path for path, _ in fields(figures)}
        assert written <= set(documented(system=True))


def test_what_was_not_recorded_as_it_must_be_is_refused(tmp_path: Path) -> None:
    """A column twice, a record that is too short."""
    lags(tmp_path, 0.0)
    system = ssp.read(tmp_path / "system.ssp", tmp_path)
    two = {"drive": np.zeros(200), "a.u": np.ones(200), "a.x": np.ones(200)}
    write_record(tmp_path / "two.csv", 0.05 * np.arange(200), two, dict.fromkeys(two, "1"))
    with pytest.raises(UserError, match=r"two.csv: .* is a.u, and another column is too"):
        diagnose_system(tmp_path / "two.csv", system)
    short = {name: values[:50] for name, values in two.items() if name != "drive"}
    write_record(tmp_path / "short.csv", 0.05 * np.arange(50), short, dict.fromkeys(short, "1"))
    with pytest.raises(UserError, match="50 samples are too few; 100 are the least"):
        diagnose_system(tmp_path / "short.csv", system)
