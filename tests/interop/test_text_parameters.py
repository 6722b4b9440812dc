"""Claims: a text parameter in an exported system reaches libcosim and Ecos as it reaches our
master, not fmpy.ssp.
"""

from __future__ import annotations

import pytest

from orchestration.system import Member, System, ssp
from tests.support.master.sleeper import build_sleeper
from tests.support.system.hosts import run_ecos_ssp, run_libcosim_ssp, run_own_ssp

TEXT = "tcp://127.0.0.1:5570"
SIGNALS = ["a.characters", "a.checksum"]


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("text")
    path = folder / "one.ssp"
    ssp.write(
        System("one", (Member("a", build_sleeper(folder), {"label": TEXT}),), (), step=0.1), path
    )
    return path


@pytest.mark.parametrize("run", [run_own_ssp, run_libcosim_ssp, run_ecos_ssp])
def test_masters_that_pass_texts_on(exported, run):
    signals = run(exported, 0.1, 2, {}, SIGNALS)
    assert [int(signals[name][-1]) for name in SIGNALS] == [len(TEXT), sum(TEXT.encode())]


def test_fmpy_passes_no_parameters_on_and_refuses_a_text_that_it_is_handed(exported):
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import Parameter, ParameterSet

    table = simulate_ssp(str(exported), stop_time=0.15, step_size=0.1)
    assert table["a.characters"][-1] == len("abc")
    handed = ParameterSet(parameters=[Parameter(name="a.label", value=TEXT)])
    with pytest.raises(Exception, match="Unsupported type: String"):
        simulate_ssp(str(exported), stop_time=0.15, step_size=0.1, parameter_set=handed)
