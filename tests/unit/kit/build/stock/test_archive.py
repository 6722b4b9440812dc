"""Claims: what pythonfmu cannot carry is refused in a line; what it does not promise is said."""

from __future__ import annotations

import importlib
import io
import subprocess
import sys
import zipfile
from types import SimpleNamespace

import pytest

from fmus import component
from fmus.kit import build as kit
from fmus.kit.build.stock.archive import LIMITS
from fmus.kit.errors import UserError
from tests.support import source

pytest.importorskip("pythonfmu", reason="pythonfmu is not installed")


def test_a_proxy_is_refused_with_a_line():
    with pytest.raises(UserError, match="rig_proxy asks something outside of it"):
        kit.build(component("rig_proxy"), "pythonfmu")


def test_a_platform_without_a_binary_is_refused_with_those_that_have_one():
    with pytest.raises(UserError, match="no binary for darwin64; it has some for linux64, win64"):
        kit.build(component("ppy_actuator"), "pythonfmu", ["darwin64"])


def test_the_package_of_an_fmu_that_this_process_has_run_is_not_that_of_the_build(
    monkeypatch, tmp_path
):
    """Its resources come first in the path of modules, and have no binaries."""
    (tmp_path / "pythonfmu").mkdir()
    (tmp_path / "pythonfmu" / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    for name in [name for name in sys.modules if name.partition(".")[0] == "pythonfmu"]:
        monkeypatch.delitem(sys.modules, name)
    assert str(importlib.import_module("pythonfmu").__file__).startswith(str(tmp_path))
    with pytest.raises(UserError, match="no binary for darwin64; it has some for linux64, win64"):
        kit.build(component("ppy_actuator"), "pythonfmu", ["darwin64"])


def test_without_platforms_it_has_all_that_pythonfmu_has():
    archive = zipfile.ZipFile(io.BytesIO(kit.build(component("ppy_actuator"), "pythonfmu")))
    found = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    assert found == {"linux64", "win64"}


def test_without_pythonfmu_it_is_said_what_to_install(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(UserError, match=r'pip install "ppy-rig\[pythonfmu\]"'):
        kit.build(component("ppy_actuator"), "pythonfmu")


def test_a_builder_that_fails_is_told_in_a_line(monkeypatch):
    failed = SimpleNamespace(returncode=1, stderr="Traceback\nValueError: no such thing\n")
    monkeypatch.setattr(subprocess, "run", lambda *args, **kwargs: failed)
    with pytest.raises(
        UserError, match=r"^pythonfmu failed for ppy_actuator: ValueError: no such thing$"
    ):
        kit.build(component("ppy_actuator"), "pythonfmu")


def test_what_is_not_promised_stands_in_the_how_to():
    page = " ".join(
        (source.ROOT / "docs" / "how-to" / "other-tools.md").read_text(encoding="utf-8").split()
    )
    for limit in LIMITS:
        assert limit in page
