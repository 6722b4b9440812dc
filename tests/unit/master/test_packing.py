"""Systems that cannot become one FMU are refused in one line."""

from __future__ import annotations

import pytest

from fmus import component
from fmus.kit import UserError
from orchestration.master import pack
from orchestration.system import Member, Port, System
from tests.support.packed import Section


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
