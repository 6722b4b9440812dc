"""Claims: the package of a Python FMU holds all that it imports, and makes its class again."""

import pytest

from fmus.kit import UserError, stack
from fmus.kit.build.package import RUNTIME_MODULES, name_in_package, python_package
from fmus.kit.curves import EffectNames, curve
from fmus.kit.sensors import sensor_lag
from fmus.ppy_actuator.model import PpyActuator

ROOT = "resources/python/"


def test_the_kit_and_the_component_s_own_modules_travel():
    files = python_package(PpyActuator)
    for name in RUNTIME_MODULES:
        assert f"{ROOT}kit/{name}.py" in files
    assert f"{ROOT}ppy_actuator/model.py" in files
    assert "no packages beyond" in files["documentation/externalDependencies.txt"].decode()


def test_every_module_of_the_kit_that_is_imported_travels():
    for name in RUNTIME_MODULES:
        text = python_package(PpyActuator)[f"{ROOT}kit/{name}.py"].decode()
        for line in text.splitlines():
            if line.startswith("from ."):
                _, place, _, name = line.split()[:4]
                assert (place.removeprefix(".") or name) in RUNTIME_MODULES


def test_made_effects_are_made_again(tmp_path, monkeypatch):
    names = EffectNames("bend", ("bend_amount", "bend_width"), "film")
    effects = (
        sensor_lag(PpyActuator, "voltage"),
        curve(PpyActuator, "film_voltage", "charge", "saturating", "V", names=names),
    )
    cls = stack(PpyActuator, *effects, defaults={"bend_amount": 0.25})
    for path, contents in python_package(cls).items():
        if path.startswith(ROOT):
            target = tmp_path / "packed_actuator" / path.removeprefix(ROOT)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(contents)
    monkeypatch.syspath_prepend(str(tmp_path))
    import packed_actuator

    model = packed_actuator.MODEL
    assert model.name == cls.name
    assert model.layout.names == cls.layout.names
    assert [v.start for v in model.layout.parameters] == [v.start for v in cls.layout.parameters]


def test_a_class_in_a_function_cannot_travel():
    class Inside(PpyActuator):
        name = "inside"

    with pytest.raises(UserError, match="Inside is not defined at the top of a module"):
        python_package(Inside)


def test_modules_have_a_place_below_the_package():
    assert name_in_package("fmus.foot.model") == "foot.model"
    assert name_in_package("lab.models.creep") == "packages.lab.models.creep"
