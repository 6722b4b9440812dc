"""A user's own model, in a file outside the package, becomes an FMU, or is refused."""

from __future__ import annotations

import importlib
import importlib.util
import itertools
import math
import sys
import zipfile

import pytest

from fmus import component
from fmus.kit import UserError, stack
from fmus.kit.build.building import build, plan_build
from fmus.kit.build.toolchain import host_platform
from tests.contract.models import DoubledVoltage
from tests.contract.raw import instance

_count = itertools.count()
LAG = '''
"""A model of somebody."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from fmus.kit import (
    Component,
    Input,
    Output,
    State,
)
{imports}
if TYPE_CHECKING:
    import numpy

RATE = math.log(2.0)


class Lag(Component):
    """Half a second of delay."""

    name = "lag"
    u = Input("1", doc="input")
    x = State("1", rate="x_rate", output=True, doc="state")

    def x_rate(self):
        return RATE * (self.u - self.x)

    @Output("1")
    def y(self):
        """Something of it."""
        {law}
'''


def write(path, imports="", law="return 2.0 * self.x"):
    path.write_text(LAG.format(imports=imports, law=law))
    return path


def load(path):
    """Load a model as ``path/to/file.py:Lag`` does."""
    spec = importlib.util.spec_from_file_location(f"own_model_{next(_count)}", path)
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Lag


def run(cls, runtime, tmp_path, output="y"):
    path = tmp_path / f"{cls.name}.fmu"
    path.write_bytes(build(cls, runtime, [host_platform()]))
    with instance(path) as one:
        one.initialize({"u": 1.0})
        one.step(1.0)
        return one.get(output)[0]


@pytest.mark.parametrize("file", ["lag.py", "my-lag 2.py", "slave.py", "größe.py"])
def test_single_file(tmp_path, runtime, file):
    assert run(load(write(tmp_path / file)), runtime, tmp_path) == pytest.approx(1.0, rel=1e-8)


def test_functions_of_the_kit_by_their_full_name(tmp_path, runtime):
    cls = load(
        write(tmp_path / "lag.py", "from fmus.kit.functions import exp", "return exp(self.x)")
    )
    assert run(cls, runtime, tmp_path) == pytest.approx(math.exp(0.5), rel=1e-8)


def test_import_inside_a_law(tmp_path, runtime):
    law = "from fmus.kit import exp; return exp(self.x)"
    assert run(load(write(tmp_path / "lag.py", law=law)), runtime, tmp_path) == pytest.approx(
        math.exp(0.5), rel=1e-8
    )


@pytest.mark.parametrize(
    "statement",
    [
        "from .helpers.gains import GAIN",
        "from {package}.gain import GAIN",
        "from . import gain; GAIN = gain.GAIN",
        "from {package}.helpers import gains as g, TWO; GAIN = g.GAIN * TWO / 2.0",
    ],
)
def test_modules_beside_the_model(tmp_path, runtime, statement, monkeypatch):
    package = f"own_package_{next(_count)}"
    folder = tmp_path / package
    (folder / "helpers").mkdir(parents=True)
    for place in (folder, folder / "helpers"):
        (place / "__init__.py").write_text("")
    (folder / "helpers" / "__init__.py").write_text("from math import sqrt\nTWO = sqrt(4.0)\n")
    (folder / "gain.py").write_text("from .deeper import THREE\nGAIN = THREE\n")
    (folder / "deeper.py").write_text("THREE = 3.0\n")
    (folder / "helpers" / "gains.py").write_text("from ..gain import GAIN\n")
    write(folder / "lag.py", statement.format(package=package), "return GAIN * self.x")
    monkeypatch.syspath_prepend(str(tmp_path))
    cls = importlib.import_module(f"{package}.lag").Lag
    assert run(cls, runtime, tmp_path) == pytest.approx(1.5, rel=1e-8)


def test_effect_of_a_user_over_a_component(built, runtime):
    base = component("ppy_actuator")
    with instance(built(stack(base, DoubledVoltage, name="doubled"), runtime)) as one:
        one.initialize({"current": 1.0})
        assert one.get("voltage")[0] == pytest.approx(2.0 * 0.43 * 2.35 / (0.43 + 2.35), rel=1e-12)


def test_laws_of_a_user_over_a_stack(tmp_path, runtime):
    (tmp_path / "lag.py").write_text("""
from fmus.kit import Component, Effect, Output, State, stack


class Plain(Component):
    name = "plain"
    x = State("1", rate="still")

    def still(self):
        return 0.0

    @Output("1")
    def y(self):
        return self.x


class Raised(Effect):
    id = "raised"

    def y(self):
        return 1.0 + super().y()


class Lag(stack(Plain, Raised, defaults={"x_start": 5.0})):
    name = "tripled"

    def y(self):
        return 3.0 * super().y()
""")
    path = tmp_path / "tripled.fmu"
    path.write_bytes(build(load(tmp_path / "lag.py"), runtime, [host_platform()]))
    with instance(path) as one:
        one.initialize()
        assert one.get("y")[0] == 3.0 * (1.0 + 5.0)


def test_effects_of_one_name_from_two_modules(tmp_path, built, runtime):
    effect = """
from fmus.kit import Effect


class Lag(Effect):
    id = "{id}"

    def terminal_voltage(self):
        return {factor} * super().terminal_voltage()
"""
    effects = []
    for name, factor in (("two", 2.0), ("three", 3.0)):
        (tmp_path / f"{name}.py").write_text(effect.format(id=name, factor=factor))
        effects.append(load(tmp_path / f"{name}.py"))
    assert effects[0].__name__ == effects[1].__name__
    with instance(
        built(stack(component("ppy_actuator"), *effects, name=f"six_{next(_count)}"), runtime)
    ) as one:
        one.initialize({"current": 1.0})
        assert one.get("voltage")[0] == pytest.approx(6.0 * 0.43 * 2.35 / (0.43 + 2.35), rel=1e-12)


def test_text_of_the_model_is_kept_but_for_the_imports(tmp_path):
    path = write(tmp_path / "lag.py")
    text = plan_build(load(path), "python").files["resources/python/models/lag.py"].decode()
    assert text == path.read_text().replace("from fmus.kit import", "from ..kit import")


def test_archive_has_nothing_of_this_machine(tmp_path):
    data = build(load(write(tmp_path / "lag.py")), "python", [host_platform()])
    (tmp_path / "lag.fmu").write_bytes(data)
    with zipfile.ZipFile(tmp_path / "lag.fmu") as archive:
        for name in archive.namelist():
            assert str(tmp_path).encode() not in archive.read(name), name


@pytest.mark.parametrize(
    ("imports", "message"),
    [
        ("import numpy as np", "lag.py, line 15: 'import numpy' cannot go into a Python FMU"),
        ("from numpy import exp", "lag.py, line 15: numpy cannot go into a Python FMU"),
        ("import fmus.kit", "lag.py, line 15: 'import fmus.kit' cannot go into a Python FMU"),
        (
            "from fmus.kit import units",
            "lag.py, line 15: fmus.kit.units is not part of a Python FMU",
        ),
        (
            "from fmus.kit.units import convert",
            "lag.py, line 15: fmus.kit.units is not part of a Python FMU",
        ),
    ],
)
def test_what_cannot_come_along_is_told_with_its_line(tmp_path, imports, message):
    cls = load(write(tmp_path / "lag.py", imports))
    with pytest.raises(UserError) as caught:
        plan_build(cls, "python")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    plan_build(cls, "native")  # the laws are compiled; nothing has to come along


def test_class_inside_a_function_is_refused(tmp_path):
    def make():
        class Inner(component("ppy_actuator")):
            """Not at the top of a module."""

            name = "inner"

        return Inner

    with pytest.raises(UserError, match="not defined at the top of a module"):
        plan_build(make(), "python")
