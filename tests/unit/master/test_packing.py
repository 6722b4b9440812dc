"""Systems that cannot become one FMU are refused in one line."""

from __future__ import annotations

import pytest

from fmus import component
from fmus.kit import UserError
from orchestration.master import pack
from orchestration.system import Member, Port, System
from tests.support.master.circle import BOTH, CIRCLE
from tests.support.master.samples import ring
from tests.support.packed import Section


def test_a_member_without_equations_is_refused(member):
    refused = (
        r"^system \w+: member a cannot be packed: .* without equations; run the system as \.ssp"
    )
    with pytest.raises(UserError, match=refused):
        pack(ring(member, BOTH, CIRCLE))


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
