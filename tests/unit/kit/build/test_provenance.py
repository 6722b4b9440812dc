"""Claims: a description gives back the parts of a component, and builds stay reproducible."""

from hashlib import sha256
from pathlib import Path
from xml.etree.ElementTree import Element

import pytest

from fmus.kit import stack
from fmus.kit.build import plan_build
from fmus.kit.build.provenance import Provenance, annotate_fmi2, read_provenance
from fmus.kit.sampling import Sampling
from fmus.kit.sensors import sensor_lag
from fmus.kit.symbolic import trace
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from tests.support import kit_samples


def annotated(cls):
    root = Element("fmiModelDescription")
    annotate_fmi2(root, cls, trace(cls))
    return root


def test_a_component_of_ours_is_given_back_with_its_effects_and_remarks():
    effects = (EFFECTS["quadratic_strain"], sensor_lag(PpyActuator, "voltage"))
    cls = stack(PpyActuator, *effects)
    cls.remark = "Fitted to hidden.csv\nOnce"
    origin = read_provenance(annotated(cls))
    assert origin == Provenance(
        component="ppy_actuator",
        laws=trace(cls).digest,
        effects=("quadratic_strain", "sensor_lag(voltage)"),
        remarks=("Fitted to hidden.csv", "Once"),
    )
    assert origin.place == "ppy_actuator"


def test_the_sampling_that_an_effect_was_made_for_is_given_back():
    sampling = Sampling(2.5e-05, 0.05)
    lag = sensor_lag(PpyActuator, "voltage", sampling)
    origin = read_provenance(annotated(stack(PpyActuator, EFFECTS["quadratic_strain"], lag)))
    assert origin.effects == ("quadratic_strain", "sensor_lag(voltage)")
    assert origin.samplings == {"sensor_lag(voltage)": sampling}


def test_a_user_s_class_is_given_back_by_its_file(monkeypatch):
    path = Path(kit_samples.__file__)
    monkeypatch.chdir(path.parent)
    origin = read_provenance(annotated(stack(kit_samples.Thermostat, kit_samples.Warmer)))
    assert (origin.component, origin.file, origin.cls) == ("", "kit_samples.py", "Thermostat")
    assert origin.sha256 == sha256(path.read_bytes()).hexdigest()
    assert origin.place == "kit_samples.py:Thermostat"


def test_a_component_of_ours_alone_tells_its_name_and_its_laws():
    laws = trace(PpyActuator).digest
    assert read_provenance(annotated(PpyActuator)) == Provenance("ppy_actuator", laws=laws)


def test_of_a_user_s_class_alone_or_without_a_file_nothing_is_written():
    assert read_provenance(annotated(kit_samples.Thermostat)) is None
    local = type("Local", (PpyActuator,), {"name": "local"})
    assert read_provenance(annotated(stack(local, EFFECTS["quadratic_strain"]))) is None


@pytest.mark.parametrize("cls", [PpyActuator, kit_samples.Thermostat])
@pytest.mark.parametrize(("runtime", "fmi"), [("native", 2), ("python", 2), ("native", 3)])
def test_a_component_alone_is_the_same_bytes_from_every_folder(
    cls, runtime, fmi, tmp_path, monkeypatch
):
    plans = []
    for folder in (Path(kit_samples.__file__).parent, tmp_path):
        monkeypatch.chdir(folder)
        plans.append(plan_build(cls, runtime, fmi))
    assert plans[0] == plans[1]
