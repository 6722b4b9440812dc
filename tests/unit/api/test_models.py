"""Claims: a component is built as an FMU, and an FMU is checked against the contract."""

from __future__ import annotations

import pytest

import orchestration as ppy
from fmus.kit import UserError
from fmus.kit.build import host_platform
from orchestration.fmu.archive import Archive
from tests.support.archive import edited


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "saturating.fmu"
    assert ppy.build("ppy_actuator", path, effects=["strain_saturation"]) == path
    return path


def test_an_fmu_has_the_effects_asked_for_and_this_machines_platform(built):
    model = ppy.find_model(str(built))
    assert "strain_saturation_coefficient" in model.parameters
    with Archive(built) as archive:
        assert archive.platforms == [host_platform()]


def test_a_class_is_built_as_its_name_is(built, tmp_path):
    cls = ppy.find_model("ppy_actuator", effects=["strain_saturation"]).cls
    assert ppy.build(cls, tmp_path / "again.fmu").read_bytes() == built.read_bytes()


def test_what_is_wrong_in_an_fmu_comes_first(built, tmp_path):
    assert "error" not in [finding.severity for finding in ppy.check(built)]
    spoilt = edited(
        built,
        tmp_path / "spoilt.fmu",
        lambda name, content: (
            name,
            content.replace(b"<InitialUnknowns>", b"<InitialUnknowns><Unknown index='9999'/>"),
        ),
    )
    first = ppy.check(spoilt)[0]
    assert (first.severity, first.line) == ("error", 1)


def test_what_is_no_fmu_is_refused(tmp_path):
    (tmp_path / "none.fmu").write_text("no archive")
    with pytest.raises(UserError, match=r"none\.fmu"):
        ppy.check(tmp_path / "none.fmu")
    with pytest.raises(UserError, match="no effect named 'strain_saturatio'"):
        ppy.build("ppy_actuator", tmp_path / "a.fmu", effects=["strain_saturatio"])
    assert not (tmp_path / "a.fmu").exists()


@pytest.mark.slow
def test_a_system_is_built_as_one_fmu(tmp_path):
    path = ppy.build("dma_bench", tmp_path / "bench.fmu")
    assert {"bench.K", "actuator.R1"} < ppy.find_model(str(path)).parameters.keys()
    for refused in ({"fmi": 3}, {"runtime": "python"}, {"effects": ["strain_lag"]}):
        with pytest.raises(UserError, match="dma_bench is a system, which is built native"):
            ppy.build("dma_bench", tmp_path / "b.fmu", **refused)
