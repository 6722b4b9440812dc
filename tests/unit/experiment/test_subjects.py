"""Claims: a subject says what can be given to it and what not, and why."""

import numpy as np
import pytest

from fmus import component
from fmus.kit.build import build_cached
from orchestration.experiment import parse
from orchestration.experiment.subjects import open_subject
from orchestration.system import Member, Port, System, ssp
from tests.support.archive import edited, of_other_laws
from tests.support.command import here, refused, works
from tests.support.experiments import good_experiment
from tests.support.fmi3_fmus import changed


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


def test_an_experiment_on_an_fmu_lasts_as_long_as_its_default_experiment(tmp_path):
    times = ('startTime="0" stopTime="2"', 'startTime="5" stopTime="7.5"')
    fmu = changed("lag", tmp_path, *times)
    with open_subject(parse({"component": str(fmu)}, "here"), "here") as subject:
        assert (subject.duration, subject.step) == (2.5, 0.05)
    works("simulate", fmu, "--out", "run.csv", cwd=tmp_path)
    time = np.loadtxt(tmp_path / "run.csv", delimiter=",", skiprows=1, usecols=0)
    assert time == pytest.approx(np.linspace(5.0, 7.5, 51))


def test_so_it_is_after_the_experiment_that_names_it(folder):
    (folder / "cut.ssp").write_bytes(b"PK\x03\x04")
    (folder / "s.toml").write_text('system = "cut.ssp"', "utf-8")
    line = refused(folder, "run", "s.toml", parts=["error: s.toml: ", "cut.ssp: not a zip"])
    assert line.count("cut.ssp") == 1


@pytest.fixture
def of_old_laws(folder):
    """The folder of a system of two members, of one FMU whose laws are none of those here."""
    made = build_cached(component("ppy_actuator"), "native")
    old = edited(made, folder / "old.fmu", of_other_laws)
    members = tuple(Member(name, old, {"force": 0.0}) for name in ("one", "two"))
    driven = {"current": tuple(Port(member.name, "current") for member in members)}
    ssp.write(System("s", members, (), driven), folder / "s.ssp")
    return folder


VARIANTS = """
inputs = {current = 0.1}
duration = "1 s"
[variants]
small = {"%sR1" = 0.4}
large = {"%sR1" = 0.6}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ("run", "s.ssp", "--set", "inputs.current=0.1"),
        ("run", "variants.toml"),
        ("run", "component.toml"),
        ("simulate", "s.ssp", "--set", "current=0.1", "--stop", "1s"),
        ("sweep", "s.ssp", "--over", "one.R1=0.4,0.6", "--set", "current=0.1", "--stop", "1s"),
    ],
    ids=" ".join,
)
def test_laws_that_are_not_known_are_told_once(of_old_laws, command):
    for name, text, prefix in (
        ("variants", 'system = "s.ssp"', "one."),
        ("component", 'component = "old.fmu"', ""),
    ):
        whole = text + VARIANTS % (prefix, prefix)
        (of_old_laws / f"{name}.toml").write_text(whole, encoding="utf-8")
    done = here(*command, cwd=of_old_laws)
    assert done.returncode == 0, done.stderr
    told = [line for line in done.stderr.splitlines() if "its laws have changed" in line]
    assert len(told) == 1
    assert told[0].startswith("noted: old.fmu was made from ppy_actuator, but its laws")


def test_only_systems_whose_laws_are_known_are_fused(of_old_laws):
    folder = of_old_laws
    (folder / "s.toml").write_text(
        'system = "s.ssp"\nmaster = {method = "fused"}\n[inputs]\ncurrent = 1', "utf-8"
    )
    refused(folder, "run", "s.toml", parts=["one (", "cannot be fused", "laws"])
