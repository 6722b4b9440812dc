"""Systems that cannot become one FMU are refused in one line."""

from __future__ import annotations

import pytest

from fmus import component
from fmus.kit import UserError
from orchestration.master import pack
from orchestration.system import Member, Port, System
from tests.support.packed import Section


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


@pytest.mark.slow
def test_a_proxy_is_refused():
    proxy = Member.of("proxy", component("rig_proxy"))
    with pytest.raises(UserError, match=r"member proxy \(rig_proxy\) .* stands for a device"):
        pack(System("rig", (proxy,), ()))


@pytest.mark.slow
def test_a_connector_with_the_name_of_a_parameter_is_refused():
    members = (Member.of("first", Section),)
    system = System("taken", members, (), {"first.tau": (Port("first", "u"),)})
    with pytest.raises(UserError, match=r"the name of the parameter 'first\.tau'"):
        pack(system)
