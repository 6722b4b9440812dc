"""Claims: a subject says what can be given to it and what not, and why."""

import pytest

from fmus import component
from fmus.kit.build import build_cached
from orchestration.system import Member, Port, System, ssp
from tests.support.archive import edited, of_other_laws
from tests.support.command import refused
from tests.support.experiments import good_experiment


@pytest.fixture
def folder(tmp_path):
    return good_experiment(tmp_path)


def test_an_input_of_a_member_that_is_fed_says_by_what(folder):
    for name, why in (
        ("actuator.length_change", "it receives bench.position"),
        ("actuator.current", "give it as inputs.current"),
        ("current", "give it as inputs.current"),
    ):
        text = f'system = "dma_bench"\n[parameters]\n"{name}" = 1\n'
        (folder / "bad.toml").write_text(text, encoding="utf-8")
        refused(folder, "run", "bad.toml", parts=[f"parameters.{name}: it is an input; {why}"])


@pytest.mark.parametrize("command", ["run", "simulate"])
def test_a_system_that_is_cut_off_is_named_once(folder, command):
    (folder / "cut.ssp").write_bytes(b"PK\x03\x04")
    line = refused(folder, command, "cut.ssp")
    assert line == "error: cut.ssp: not a zip archive, or one that is cut off"


def test_so_it_is_after_the_experiment_that_names_it(folder):
    (folder / "cut.ssp").write_bytes(b"PK\x03\x04")
    (folder / "s.toml").write_text('system = "cut.ssp"', "utf-8")
    line = refused(folder, "run", "s.toml", parts=["error: s.toml: ", "cut.ssp: not a zip"])
    assert line.count("cut.ssp") == 1


def test_only_systems_whose_laws_are_known_are_fused(folder):
    made = build_cached(component("ppy_actuator"), "native")
    old = edited(made, folder / "old.fmu", of_other_laws)
    member = Member("one", old, {"force": 0.0})
    ssp.write(System("s", (member,), (), {"current": (Port("one", "current"),)}), folder / "s.ssp")
    (folder / "s.toml").write_text(
        'system = "s.ssp"\nmaster = {method = "fused"}\n[inputs]\ncurrent = 1', "utf-8"
    )
    refused(folder, "run", "s.toml", parts=["one (", "cannot be fused", "laws"])
