"""Claims: ``ppy export modelica`` writes a package that a compiler reads, over no other one."""

import json
import os
import re
import sys
from pathlib import Path

import pytest
import rumoca

from fmus.kit import files
from fmus.kit.build import host_platform
from tests.support.command import here, works


@pytest.mark.slow
def test_a_package_of_named_components(tmp_path):
    printed = works("export", "modelica", "ppy_actuator", "pid", "--out", "made", cwd=tmp_path)
    assert printed == f"wrote {Path('made') / 'PpyRig'}\n"
    order = (tmp_path / "made" / "PpyRig" / "package.order").read_text().split()
    assert order == ["Interfaces", "Functions", "Sources", "PpyActuator", "Pid"]
    session = rumoca.Session(roots=[str(tmp_path / "made" / "PpyRig")])
    assert session.loads("model T PpyRig.PpyActuator m; end T;", model="T").states.names


def test_effects_are_laid_over_a_named_component(tmp_path):
    works("export", "modelica", "ppy_actuator", "--with", "self_heating,slack", cwd=tmp_path)
    folder = tmp_path / "modelica" / "PpyRig"
    text = (folder / "PpyActuatorWithSelfHeatingWithSlack.mo").read_text()
    assert "Real temperature_rise(start=temperature_rise_start" in text
    assert "parameter Real conductance_rise_per_kelvin" in text


def test_fitted_values_and_settings_are_defaults(tmp_path):
    """A logarithm that is normally distributed has its centre at the estimate."""
    figures = {"value": 0.61, "ci95": [0.6, 0.62], "unit": "ohm", "logarithmic": True}
    fit = {"set": {"k1": 5e3, "R2": 3.0}, "fitted": {"parameters": {"R1": figures}}}
    fit["fitted"]["correlations"] = []
    (tmp_path / "fit.json").write_text(json.dumps(fit))
    given = ("--fitted", "fit.json", "--set", "k1=7 N/mm")
    works("export", "modelica", "ppy_actuator", *given, cwd=tmp_path)
    folder = tmp_path / "modelica" / "PpyRig"
    for path in (folder / "PpyActuator.mo", folder / "Resources" / "Pymoca" / "PpyRig.mo"):
        declared = re.findall(r"parameter Real (\w+)\(.*\) = (\S+) ", path.read_text())
        values = {name: float(value) for name, value in declared}
        assert values["R1"] == pytest.approx(0.61, rel=1e-12)
        assert (values["R2"], values["k1"], values["C"]) == (3.0, 7e3, 2.7)


def test_fmus_come_with_what_loads_them(tmp_path):
    works("export", "modelica", "pid", "--fmus", cwd=tmp_path)
    folder = tmp_path / "modelica" / "PpyRig"
    assert (folder / "package.order").read_text().split()[2:] == ["Sources", "FMUs", "Pid"]
    assert (folder / "FMUs" / "package.order").read_text().split() == [
        "Instance",
        "communicate",
        "Pid",
    ]
    resources = folder / "Resources"
    assert [path.stem for path in (resources / "Library" / host_platform()).iterdir()] == ["pid"]
    assert (resources / "Include" / "ppy_rig_fmu.h").is_file()
    assert (resources / "Licences" / "license.txt").is_file()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("galvanosta",), "no component named 'galvanosta' (did you mean galvanostat?)"),
        (("rig_proxy",), "rig_proxy: it has an engine in the place of laws"),
        (("pid", "pid"), "pid: there is a model Pid already; name each once"),
        (("--with", "slack"), "--with, --set and --fitted are about one model; name it"),
        (("--set", "R1=0.5"), "--with, --set and --fitted are about one model; name it"),
        (("pid", "--set", "R1=0.5"), "pid: no parameter named 'R1'"),
        (("pid", "--fitted", "none.json"), "none.json: cannot be read: No such file or directory"),
        (
            ("--out", "taken"),
            f"--out taken: {os.path.join('taken', 'PpyRig')} is there and not empty",
        ),
        (("--out", "file"), "cannot write file:"),
        (
            ("--out", "other"),
            f"--out other: {os.path.join('other', 'PpyRig')} is there and no folder",
        ),
    ],
)
def test_what_cannot_be_written_is_told_in_a_line(arguments, message, tmp_path):
    (tmp_path / "taken" / "PpyRig").mkdir(parents=True)
    (tmp_path / "taken" / "PpyRig" / "mine.mo").touch()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "PpyRig").touch()
    (tmp_path / "file").touch()
    done = here("export", "modelica", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {message}")
    assert done.stderr.count("\n") == 1
    assert done.stderr.isascii()


@pytest.mark.skipif(
    sys.platform == "win32" or os.geteuid() == 0, reason="permissions do not hold for root"
)
def test_a_folder_that_cannot_be_written_to_is_told(tmp_path):
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o555)
    done = here("export", "modelica", "pid", "--out", "locked", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "error: cannot write locked: " + f"{locked} is read-only\n"


def test_a_package_that_comes_meanwhile_stays(tmp_path, monkeypatch):
    plain = files.put

    def put(path, contents):
        plain(path, contents)
        mine = tmp_path / "modelica" / "PpyRig" / "mine.mo"
        mine.parent.mkdir(exist_ok=True)
        mine.touch()

    monkeypatch.setattr(files, "put", put)
    done = here("export", "modelica", "pid", cwd=tmp_path)
    assert done.returncode == 2
    assert f"{Path('modelica') / 'PpyRig'} is there and not empty" in done.stderr
    assert [p.name for p in tmp_path.rglob("*")] == ["modelica", "PpyRig", "mine.mo"]
