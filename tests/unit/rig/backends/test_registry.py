"""Registry: a backend is opened by its name or file, and one line says what is wrong."""

from __future__ import annotations

import builtins
import sys
from pathlib import Path
from typing import Any

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.backends.backend import Steppable
from orchestration.rig.backends.registry import backend_class, backends, device_names, open_backend

OWN = """
from orchestration.rig.backends.backend import Backend, Limit


class Lamp(Backend):
    closed = 0

    def __init__(self, bulb: str, colour: str = "red"):
        if bulb == "broken":
            raise OSError("no\\nlight")
        self.inputs = {"power": "W"}
        self.outputs = {"light": "lm"}
        self.limits = {"power": Limit(0.0, 5.0)}
        if bulb == "vague":
            del self.limits
        if bulb == "odd":
            self.limits = {"heat": Limit()}

    def read(self):
        return {"light": 0.0}

    def write(self, values):
        pass

    def safe(self):
        pass

    def close(self):
        Lamp.closed += 1


class Half(Backend):
    def read(self):
        return {}
"""


@pytest.fixture
def own(tmp_path: Path) -> str:
    path = tmp_path / "lamps.py"
    path.write_text(OWN, encoding="utf-8")
    return str(path)


def test_one_of_ones_own_is_opened_by_its_file(own: str) -> None:
    lamp = open_backend(f"{own}:Lamp", {"bulb": "new"})
    assert dict(lamp.inputs) == {"power": "W"}
    lamp.close()


@pytest.mark.parametrize(
    ("cls", "options", "message"),
    [
        ("Lamp", {}, "option bulb is missing; write bulb=..."),
        ("Lamp", {"bulb": "new", "color": "red"}, "no option 'color' (did you mean colour?)"),
        ("Lamp", {"bulb": "broken"}, "cannot be opened: OSError: no light"),
        ("Lamp", {"bulb": "vague"}, "has no limits; a mapping by name of the signal is wanted"),
        ("Lamp", {"bulb": "odd"}, "limits of heat, which is neither an input nor an output"),
        ("Half", {}, "Half is no backend yet: it lacks close, safe, write"),
        ("Limit", {}, "Limit is not a Backend"),
        ("Lmp", {}, "there is no class 'Lmp' in it (did you mean Lamp?)"),
    ],
)
def test_what_is_wrong_with_ones_own_is_told(
    own: str, cls: str, options: dict[str, str], message: str
) -> None:
    with pytest.raises(UserError) as caught:
        open_backend(f"{own}:{cls}", options)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_backend_that_is_refused_is_closed(own: str) -> None:
    before = backend_class(f"{own}:Lamp").closed  # type: ignore[attr-defined]
    with pytest.raises(UserError):
        open_backend(f"{own}:Lamp", {"bulb": "odd"})
    assert backend_class(f"{own}:Lamp").closed == before + 1  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("emulater", "no backend 'emulater' (did you mean emulator?)"),
        ("nothing.py:X", "nothing.py: cannot be read: No such file or directory"),
        ("", "no backend ''"),
    ],
)
def test_what_is_no_backend_is_told(spec: str, message: str) -> None:
    with pytest.raises(UserError) as caught:
        open_backend(spec, {})
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("spec", "library"),
    [("nidaqmx", "nidaqmx"), ("visa", "pyvisa"), ("serial", "serial"), ("modbus", "pymodbus")],
)
def test_a_library_that_is_not_installed_is_named(
    monkeypatch: pytest.MonkeyPatch, spec: str, library: str
) -> None:
    real = builtins.__import__

    def without(name: str, *arguments: Any, **named: Any) -> Any:
        if name.partition(".")[0] == library:
            raise ModuleNotFoundError(f"No module named {library!r}", name=library)
        return real(name, *arguments, **named)

    monkeypatch.delitem(sys.modules, f"orchestration.plugins.{spec}", raising=False)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(UserError, match=rf'pip install "ppy-rig\[{spec}\]"$'):
        open_backend(spec, {})


def test_a_backend_of_an_installed_package_is_opened_by_its_name(
    tmp_path: Path, own: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = tmp_path / "lamps-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lamps\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[ppy_rig.backends]\nlamp = lamps:Lamp\ndim = lamps:Absent\nblank = lamps:OWN\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    backends.cache_clear()
    try:
        assert open_backend("lamp", {"bulb": "fine"}).outputs == {"light": "lm"}
        for name in ("dim", "blank"):
            with pytest.raises(UserError, match=f"^backend {name}: lamps:.* cannot be loaded: "):
                backend_class(name)
        with pytest.raises(UserError, match=r"no backend 'lamb'.*lamp"):
            backend_class("lamb")
    finally:
        backends.cache_clear()


def test_those_that_step_are_the_emulator_and_replay() -> None:
    steppable = {name for name in backends() if issubclass(backend_class(name), Steppable)}
    assert steppable == {"emulator", "replay"}


def test_devices_are_named_without_opening_any(tmp_path):
    path = tmp_path / "lamp.py"
    path.write_text(OWN)
    assert device_names(f"{path}:Lamp", {"bulb": "broken"}) == ("Lamp bulb=broken",)
    for name in ("emulator", "replay"):
        assert device_names(name, {"file": "none.csv"} if name == "replay" else {}) == ()
    with pytest.raises(UserError, match="option bulb is missing"):
        device_names(f"{path}:Lamp", {})
    with pytest.raises(UserError, match="no option 'colr'"):
        device_names(f"{path}:Lamp", {"bulb": "x", "colr": "x"})


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("raise OSError('no bus')", "does not say its devices: OSError: no bus"),
        ("return [3]", r"names of devices must be texts; it says \(3,\)"),
    ],
)
def test_devices_that_are_not_said_are_told(tmp_path, body, said):
    path = tmp_path / "lamp.py"
    method = (
        f"    @classmethod\n    def devices(cls, **options):\n        {body}\n\n    def read(self)"
    )
    path.write_text(OWN.replace("    def read(self)", method))
    with pytest.raises(UserError, match=said):
        device_names(f"{path}:Lamp", {"bulb": "x"})
