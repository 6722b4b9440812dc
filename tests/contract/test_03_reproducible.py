"""Line 3: the same sources give the same bytes, other sources another GUID."""

from __future__ import annotations

import hashlib
import importlib.util
import itertools
import sys
from collections.abc import Sequence

import pytest

from fmus import COMPONENTS, component
from fmus.kit import build
from fmus.kit.build.building import RUNTIMES
from fmus.kit.build.toolchain import host_platform
from tests.contract import checks
from tests.contract.subjects import actuators_only, each_front_end
from tests.support import hosts
from tests.support.pace import slow_but

_count = itertools.count()
VARIANT = """
from fmus.kit import Component, Input, Output, Parameter, State
from {module} import {base}


class Variant({base}):
    \"\"\"A variant.\"\"\"

    name = "variant"

    def capacitor_voltage(self):
        return {factor} * self.charge / self.C
"""


def digests(names: Sequence[str], runtime: str) -> list[str]:
    built = [build.build(component(name), runtime, [host_platform()]) for name in names]
    return [hashlib.sha256(archive).hexdigest() for archive in built]


def variant(folder, name, factor):
    """Write a user's model in a file of its own, and import it under a unique name."""
    base = component(name)
    folder.mkdir()
    path = folder / "variant.py"
    path.write_text(VARIANT.format(module=base.__module__, base=base.__name__, factor=factor))
    spec = importlib.util.spec_from_file_location(f"_variant_{next(_count)}", path)
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Variant


@pytest.mark.slow
@pytest.mark.parametrize(
    ("runtime", "names"),
    slow_but(
        [(runtime, names) for runtime in RUNTIMES for names in (COMPONENTS, ["galvanostat"])],
        *((runtime, ["galvanostat"]) for runtime in RUNTIMES),
    ),
    ids=lambda value: value if isinstance(value, str) else f"{len(value)} of {len(COMPONENTS)}",
)
def test_another_process_builds_the_same_bytes(fmu, runtime, names, monkeypatch, tmp_path):
    """With another order of sets, and no library that was compiled before."""
    here = [hashlib.sha256(fmu(name, runtime).read_bytes()).hexdigest() for name in names]
    monkeypatch.setenv("PYTHONHASHSEED", "4711")
    monkeypatch.setenv("PPY_CACHE", str(tmp_path))
    assert hosts.in_subprocess(digests, names, runtime) == (0, here)


@actuators_only
def test_guid_follows_the_laws(tmp_path, name, runtime):
    first, same, other = (
        build.plan_build(variant(tmp_path / folder, name, factor), runtime).guid
        for folder, factor in (("a", "2.0"), ("b", "2.0"), ("c", "2.5"))
    )
    assert first == same
    assert len({first, other, build.plan_build(component(name), runtime).guid}) == 3


@each_front_end
def test_guid_follows_default_and_range(name, runtime):
    base = component(name)
    declaration = base.layout.parameters[0]
    guids = set()
    for change in ({}, {"start": 1.01 * declaration.start}, {"max": 1.01 * declaration.max}):
        before = {key: getattr(declaration, key) for key in change}
        try:
            for key, value in change.items():
                setattr(declaration, key, value)
            guids.add(build.plan_build(base, runtime).guid)
        finally:
            for key, value in before.items():
                setattr(declaration, key, value)
    assert len(guids) == 3


def test_guid_differs_between_builds_of_one_component(name):
    assert (
        build.plan_build(component(name), "python").guid
        != build.plan_build(component(name), "native").guid
    )


def test_library_knows_the_guid_of_the_description(archive):
    checks.library_knows_the_guid_of_the_description(archive)


def test_no_time_and_no_order_of_this_machine_is_in_the_archive(archive):
    checks.no_time_and_no_order_of_this_machine(archive)
