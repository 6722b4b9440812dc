from pathlib import Path

import fmpy
import lxml.etree

from fmus.kit.build.parameters import to_ssv
from tests.support.kit_models import every_model
from tests.support.kit_samples import Thermostat

SCHEMA = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureParameterValues.xsd"


@every_model
def test_parameter_files_are_valid_by_the_schema(cls):
    schema = lxml.etree.XMLSchema(lxml.etree.parse(SCHEMA))
    declared = {p.name: p for p in cls.layout.parameters}
    everything = {p.name: p.start for p in cls.layout.parameters}
    documents = [
        to_ssv("all", everything, declared, "every parameter"),
        to_ssv("none", {}, declared),
    ]
    documents += [
        to_ssv(name, preset.values, declared, preset.doc) for name, preset in cls.presets.items()
    ]
    for document in documents:
        schema.assertValid(lxml.etree.fromstring(document))


def test_parameter_files_hold_types_values_and_units():
    declared = {p.name: p for p in Thermostat.layout.parameters}
    root = lxml.etree.fromstring(
        to_ssv("hall", Thermostat.presets["hall"].values, declared, "a big room")
    )
    found = {}
    for parameter in root.iterfind(".//{*}Parameter"):
        (value,) = parameter
        found[parameter.get("name")] = (
            lxml.etree.QName(value).localname,
            value.get("value"),
            value.get("unit"),
        )
    assert found == {
        "capacity": ("Real", "200.0", "J/K"),
        "enabled": ("Boolean", "true", None),
        "stages": ("Integer", "3", None),
        "setpoint": ("Real", "288.15", "K"),
    }
    units = {u.get("name"): dict(u[0].attrib) for u in root.iterfind(".//{*}Unit")}
    assert units == {"J/K": {"kg": "1", "m": "2", "s": "-2", "K": "-1"}, "K": {"K": "1"}}
    assert root.get("description") == "a big room"
