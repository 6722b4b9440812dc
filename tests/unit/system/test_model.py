"""Claims: systems are varied by what they are given, which the system that is varied does not
notice.
"""

import pytest

from fmus.kit.errors import UserError
from orchestration.system import System, connect
from tests.support.system.samples import pair


@pytest.fixture
def system(tmp_path):
    return System("sample", pair(tmp_path), connect("drive.force -> load.force"), {"command": ()})


def test_values_are_added_to_those_that_are_set(system):
    varied = system.given({"drive.gain": 2.0, "load.level": 3.0})
    assert varied.member("drive").parameters == {"gain": 2.0}
    assert varied.member("load").parameters == system.member("load").parameters | {"level": 3.0}
    assert system.member("drive").parameters == {}
    with pytest.raises(UserError, match=r"no member named 'drvie' \(did you mean drive\?\)"):
        system.given({"drvie.gain": 2.0})


def test_a_disconnected_input_stays_at_its_value(system):
    varied = system.disconnected("load.force", 0.5)
    assert varied.connections == ()
    assert varied.member("load").parameters["force"] == 0.5
    with pytest.raises(UserError, match=r"system sample: load\.length is not connected"):
        system.disconnected("load.length", 0.5)


# --- the voltmeter
# --------------------------------------------------------------------------------------------------
