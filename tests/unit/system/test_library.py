"""Claims: the systems of all packages make sense in both builds, and another name is refused."""

from __future__ import annotations

import pytest

from fmus.kit.errors import UserError
from orchestration.system import library
from orchestration.system.checking import check, warnings
from tests.support.pace import slow_but

# a free foot takes seconds to build
QUICK = [name for name in library.NAMES if not name.endswith("_stance")]


def test_sixteen_ship_and_another_name_is_refused():
    assert set(library.NAMES) == {
        "dma_bench",
        "isotonic_stand",
        "work_loop",
        "displacement_loop",
        "state_feedback_loop",
        "adaptive_loop",
        "tension_loop",
        "impedance_bench",
        "hil_displacement_loop",
        "degradation_watch",
        "potentiostat_watch",
        "protected_bench",
        "foot_gait",
        "foot_stance",
        "hil_stance",
        "hil_bench",
    }
    with pytest.raises(UserError, match=r"no system named 'dma_bnch' \(did you mean dma_bench\?\)"):
        library.system("dma_bnch")


@pytest.mark.parametrize("name", slow_but(library.NAMES, *QUICK))
def test_each_makes_sense_in_both_builds(name, runtime):
    system = library.system(name, runtime)
    check(system)
    assert warnings(system) == []
    assert system.doc == library.SUMMARIES[name]
    assert all(
        member.cls is not None and member.fmu.stem == member.cls.name for member in system.members
    )
