"""Claims: identified values become a set that a system binds, or a line says why not."""

from xml.etree import ElementTree

import pytest

from fmus import component
from fmus.kit.errors import UserError
from orchestration.identify import parameter_set

DECLARED = {p.name: p for p in component("ppy_actuator").layout.parameters}
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"


def test_values_and_units_are_in_the_file(tmp_path):
    parameter_set.write(tmp_path / "creep.ssv", {"k1": 6295.5, "alpha": 6.8e-5}, DECLARED, "a step")
    root = ElementTree.parse(tmp_path / "creep.ssv").getroot()
    assert (root.get("name"), root.get("description")) == ("creep", "a step")
    found = {
        p.get("name"): (float(p[0].get("value")), p[0].get("unit"))
        for p in root.iter(f"{SSV}Parameter")
    }
    assert found == {"k1": (6295.5, "N/m"), "alpha": (6.8e-5, "m/C")}


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("a.xml", {"k1": 1.0}, "a.xml: a parameter set must end in .ssv"),
        ("a.ssv", {"k9": 1.0}, "a.ssv: no parameter is named k9; there are R1, "),
        ("a.ssv", {"k1": float("inf")}, "a.ssv: k1 = inf is no finite number"),
        ("a.ssv", {"k1": float("nan")}, "a.ssv: k1 = nan is no finite number"),
    ],
)
def test_what_cannot_be_bound_is_refused(name, values, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError) as refusal:
        parameter_set.write(name, values, DECLARED)
    assert str(refusal.value).startswith(message)
    assert list(tmp_path.iterdir()) == []
