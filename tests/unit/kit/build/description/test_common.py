"""Claims: both versions name the same author, date and units; a date that is none is refused."""

import re
from pathlib import Path

import lxml.etree
import pytest

import fmus
from fmus.kit import Effect, UserError, stack
from fmus.kit.build import version
from fmus.kit.build.description import Capabilities, describe_fmi2, describe_fmi3
from fmus.kit.symbolic import trace
from fmus.ppy_actuator.effects import EFFECTS
from tests.support.kit_models import GUID
from tests.support.kit_samples import Adder, Divider

ROOT = Path(__file__).parents[5]
CAN = Capabilities(
    needs_execution_tool=False, interpolates_inputs=True, directional_derivatives=True
)

pytestmark = pytest.mark.parametrize("describe", [describe_fmi2, describe_fmi3])


def root_of(describe, cls):
    return lxml.etree.fromstring(describe(cls, trace(cls), CAN, "1.2.3", GUID))


def test_author_copyright_and_licence_are_the_components_own(describe):
    def origin(cls):
        root = root_of(describe, cls)
        return root.get("author"), root.get("copyright"), root.get("license")

    class Signed(Divider):
        author = "A. Person"
        copyright = "Copyright (c) A. Person"

    ours = fmus.component("ppy_actuator")
    (holder,) = re.findall("^Copyright.*$", (ROOT / "LICENSE").read_text(encoding="utf-8"), re.M)
    project = ("the ppy-rig project", holder, "BSD-3-Clause")
    assert origin(ours) == origin(stack(ours, *EFFECTS.values())) == project
    assert origin(Divider) == (None, None, None)
    assert origin(Signed) == ("A. Person", "Copyright (c) A. Person", None)

    class Own(Effect):
        id = "own"

    assert origin(stack(ours, Own)) == (None, None, None)


def test_date_is_that_of_the_version(monkeypatch, describe):
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    (date,) = re.findall(
        rf"^## \[{re.escape(version())}\] - (\S+)$",
        (ROOT / "CHANGELOG.md").read_text("utf-8"),
        re.M,
    )
    assert root_of(describe, Divider).get("generationDateAndTime") == f"{date}T00:00:00Z"


def test_date_is_that_of_the_environment(monkeypatch, describe):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")  # as `date -u -d @1000000000` has it
    assert root_of(describe, Divider).get("generationDateAndTime") == "2001-09-09T01:46:40Z"


@pytest.mark.parametrize("given", ["now", "-1", "1.5", "253402300800", "9" * 4000, "٣"])
def test_date_that_is_none_is_refused(monkeypatch, given, describe):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", given)
    with pytest.raises(
        UserError,
        match=r"^SOURCE_DATE_EPOCH = '.*': seconds since 1970 are wanted.* to 253402300799$",
    ):
        root_of(describe, Divider)


def test_only_real_numbers_vary_continuously(describe):
    """FMI 2.0.4, section 2.2.7: other types change at events alone."""
    root = root_of(describe, Adder)
    reals = {v.get("name") for v in root.iter("Float64")}
    reals |= {v.getparent().get("name") for v in root.iter("Real")} - {None}
    variables = [v for v in root.iter() if v.get("variability") is not None]
    continuous = {v.get("name") for v in variables if v.get("variability") == "continuous"}
    assert continuous - {"time"} <= reals
    assert {v.get("variability") for v in variables if v.get("name") in ("lacking", "off")} == {
        "discrete"
    }
