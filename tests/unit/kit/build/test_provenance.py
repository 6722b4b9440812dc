"""Claims: a description gives back the parts of a component, and builds stay reproducible."""

from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest

from fmus.kit import UserError, stack
from fmus.kit.build import plan_build
from fmus.kit.build.provenance import Provenance, annotate, read_provenance
from fmus.kit.law_terms import LawTerm, law_term_effect
from fmus.kit.sampling import Sampling
from fmus.kit.sensors import sensor_lag
from fmus.kit.symbolic import trace
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from tests.support import kit_samples
from tests.support.oscillator_model import Oscillator


def annotated(cls):
    root = Element("fmiModelDescription")
    annotate(root, cls, trace(cls), 2)
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


TERM = LawTerm(
    "friction",
    "velocity",
    "curve",
    "play",
    "friction_of_velocity",
    "N",
    "m/s",
    1.0,
    2.0,
    0.1,
    0.3,
    "spring_force",
    (-0.5, 1e-17, 0.25),
    0.02,
    False,
)


def test_terms_of_laws_are_given_back_with_every_value():
    first, second = TERM, replace(TERM, stem="another", places=(), shape="dry")
    terms = (first, second)
    cls = stack(Oscillator, *(law_term_effect(Oscillator, t.law, t) for t in terms))
    root = ElementTree.fromstring(ElementTree.tostring(annotated(cls)))
    origin = read_provenance(root)
    assert origin.effects == ("friction_of_velocity", "another")
    assert origin.terms == {"friction_of_velocity": first, "another": second}


@pytest.mark.parametrize(
    ("attribute", "value"), [("scale", "wide"), ("places", "1 two"), ("is_held", "__import__")]
)
def test_a_term_that_cannot_be_read_is_refused(attribute, value):
    root = annotated(stack(Oscillator, law_term_effect(Oscillator, TERM.law, TERM)))
    (term,) = root.iter("Term")
    term.set(attribute, value)
    with pytest.raises(UserError, match=f"{attribute} '{value}' cannot be read"):
        read_provenance(root)
    del term.attrib[attribute]
    with pytest.raises(UserError, match=f"{attribute} None cannot be read"):
        read_provenance(root)
