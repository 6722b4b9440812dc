"""Members without equations of a packed system: their variables as the system has them, and what is
refused in one line.
"""

from __future__ import annotations

import pytest

from fmus.kit import UserError
from orchestration.master import pack
from orchestration.master.fmu_members import fmu_members
from orchestration.system import Member, Port, System
from tests.support.archive import edited


def refusal(fmu, count=1, platforms=("linux64",)):
    members = tuple(Member(f"m{k}", fmu) for k in range(count))
    with pytest.raises(UserError) as refused:
        pack(System("files", members, ()), platforms)
    return str(refused.value)


def test_an_fmu_that_runs_once_is_refused_twice(members):
    message = refusal(members(canBeInstantiatedOnlyOncePerProcess=True), count=2)
    assert message == (
        "system files: member m1 cannot be packed: a process can have one instance of member.fmu"
        " only (canBeInstantiatedOnlyOncePerProcess)"
    )


def test_an_fmu_without_a_binary_for_the_platform_is_refused(member):
    message = refusal(member, platforms=("linux64", "win64"))
    assert message.endswith("cannot be packed for win64: its FMU has binaries for linux64")


def test_an_fmu_that_returns_before_its_step_is_done_is_refused(members):
    assert "(canRunAsynchronuously)" in refusal(members(canRunAsynchronuously=True))


def test_a_text_that_is_passed_on_is_refused(member, tmp_path):
    def as_text(name, contents):
        return name, contents.replace(b'<Real nominal="1.0" start="0"/>', b'<String start=""/>')

    path = edited(member, tmp_path / "text.fmu", as_text)
    system = System("texts", (Member("m", path),), (), {"u": (Port("m", "u"),)})
    with pytest.raises(
        UserError, match=r"m cannot be packed: text\.fmu passes on u, which is a text"
    ):
        fmu_members(system, ["m"])


def test_variables_are_those_that_the_system_sets_or_reads(member, tmp_path):
    """One has a name with brackets that are no index, and a unit that nobody knows."""

    def renamed(name, contents):
        plain = b'"u" valueReference="0" causality="input" variability="continuous"><Real'
        odd = plain.replace(b'"u"', b'"u[red]"') + b' unit="zorkmid"'
        return name, contents.replace(plain, odd)

    path = edited(member, tmp_path / "odd.fmu", renamed)
    system = System("odd", (Member("m", path),), (), {}, {"y": Port("m", "y")})
    layout = fmu_members(system, ["m"])["m"].layout
    assert [(v.name, v.unit, v.doc) for v in layout.inputs] == [("u[red]", "1", "[zorkmid]")]
    assert [v.name for v in layout.outputs] == ["y"]
    assert layout.arrays == ()
    assert "tau" in layout.parameter_index
