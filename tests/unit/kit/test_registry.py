"""Claims: packages of components are found by entry points; a broken one is left out with a line
that says which and why.
"""

import re
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from fmus.kit import UserError, registry
from fmus.kit.registry import (
    ComponentPackage,
    RegistryWarning,
    RigDeclaration,
    StimulusDeclaration,
)
from tests.support.registered import registered

ROOT = Path(__file__).parents[3]


def test_our_packages_are_those_with_a_readme_of_a_component():
    folders = {path.parent.name for path in (ROOT / "fmus").glob("*/README.md")}
    assert {place.split(".")[1] for place in registry.models().values()} == folders
    assert next(iter(registry.models())) == registry.default_model() == "ppy_actuator"


def test_listing_imports_no_model():
    code = (
        "import sys; from fmus.kit import registry; registry.models(); registry.systems();"
        "print([name for name in sys.modules if name.endswith('.model') or name == 'numpy'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.stdout.strip() == "[]", done.stderr


def test_a_package_of_somebody_else_comes_after_ours():
    tank = ComponentPackage(components={"tank": "tests.support.tank:Tank"}, default_model="tank")
    with registered(tank=tank):
        assert list(registry.components())[-1] == "tank"
        assert registry.default_model() == "ppy_actuator"


@pytest.mark.parametrize(
    ("package", "reason"),
    [
        (
            ComponentPackage(components={"foot": "x:Foot"}),
            "fmus.foot:PACKAGE has a component 'foot'",
        ),
        (
            ComponentPackage(
                stimuli={"gait": StimulusDeclaration("A gait.", "leg", ("left",), "m", "x:f")}
            ),
            "fmus.foot:PACKAGE has a kind of stimulus 'gait'",
        ),
        (
            ComponentPackage(rigs={"bench": RigDeclaration({}, {})}),
            "fmus.rig_proxy:PACKAGE has a rig 'bench'",
        ),
        ({"tank": "x:Tank"}, "it is no ComponentPackage but dict"),
        (ImportError("no module\nnamed 'x'"), "ImportError: no module named 'x'"),
        (ZeroDivisionError("in its module"), "ZeroDivisionError: in its module"),
    ],
    ids=["component", "stimulus", "rig", "no package", "import", "any error"],
)
def test_a_package_that_cannot_be_used_is_left_out(package, reason):
    ours = dict(registry.models())
    line = rf"components tank:PACKAGE of .*are left out: .*{re.escape(reason)}"
    with pytest.warns(RegistryWarning, match=line), registered(tank=package):
        assert registry.models() == ours


def test_an_installation_without_entry_points_is_told(monkeypatch):
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: ())
    with registered(), pytest.raises(UserError, match="install ppy-rig again"):
        registry.models()


@pytest.mark.parametrize(
    ("place", "message"),
    [
        (
            "no_such_module:Tank",
            "no_such_module:Tank cannot be imported: ModuleNotFoundError: No",
        ),
        ("fmus.foot.model:Tank", "fmus.foot.model:Tank cannot be imported: AttributeError: module"),
        ("fmus.foot.model:Foot", "fmus.foot.model:Foot is no component with name = 'tank'"),
        ("fmus.foot.systems:ACTUATORS", "is no component with name = 'tank'"),
    ],
)
def test_a_component_that_is_not_there_is_named(place, message):
    tank = ComponentPackage(components={"tank": place})
    with registered(tank=tank), pytest.raises(UserError, match=re.escape(message)):
        registry.component("tank")


PRESSED = """
class Pressed:
    def __set_name__(self, owner, name):
        raise KeyboardInterrupt


class Tank:
    level = Pressed()


PACKAGE = Tank
"""


@pytest.fixture
def pressed(tmp_path, monkeypatch):
    """A package of components, in which Ctrl-C is pressed while it is imported."""
    (tmp_path / "pressed_models.py").write_text(PRESSED)
    monkeypatch.syspath_prepend(tmp_path)
    return EntryPoint("pressed", "pressed_models:PACKAGE", registry.GROUP)


def test_ctrl_c_in_an_import_is_no_other_error(pressed):
    """Python 3.11 makes a RuntimeError of it."""
    with pytest.raises(KeyboardInterrupt):
        registry.load(pressed.value)
    with pytest.raises(KeyboardInterrupt):
        list(registry._load_packages([pressed]))
