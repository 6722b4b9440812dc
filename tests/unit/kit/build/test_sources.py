"""Claims: C sources of a build are complete: whatever they include is there, or of the system."""

from __future__ import annotations

import re
from collections.abc import Mapping

import pytest

from fmus import component
from fmus.kit.build import toolchain
from fmus.kit.build.sources import (
    PACKED,
    UNIT,
    c_sources,
    engine_sources,
    library_key,
    record_engine_sources,
    record_model_sources,
    record_sources,
    unit,
)
from fmus.kit.symbolic import packing, trace
from tests.support.kit_samples import Divider, Thermostat

_INCLUDE = re.compile(rb'^\s*#\s*include\s+"([^"]+)"', re.M)


def included(sources: Mapping[str, bytes], name: str) -> set[str]:
    """Names of all files that a file includes, directly or not; unknown ones are an error."""
    found: set[str] = set()
    waiting = [name]
    while waiting:
        for inner in _INCLUDE.findall(sources[waiting.pop()]):
            if inner.decode() not in found:
                found.add(inner.decode())
                waiting.append(inner.decode())
    return found


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("runtime", ["native", "python"])
@pytest.mark.parametrize("cls", [Thermostat, component("rig_proxy")], ids=lambda c: c.name)
def test_a_build_has_all_that_is_included_and_nothing_else(cls, runtime, fmi):
    sources = c_sources(trace(cls), engine_sources(cls, runtime), "{guid}", fmi)
    assert included(sources, UNIT) | {UNIT} == set(sources)


def test_only_the_native_build_has_laws():
    native, python = (
        c_sources(trace(Divider), engine_sources(Divider, runtime), "{guid}", 2)
        for runtime in ("native", "python")
    )
    assert "laws.c" in native
    assert "laws.c" not in python
    assert "python.c" in python


@pytest.mark.parametrize(
    "sources",
    [
        record_engine_sources,
        lambda: record_model_sources(trace(Thermostat)),
        lambda: record_sources(trace(Thermostat)),
    ],
    ids=["engine", "model", "both"],
)
def test_a_library_for_records_has_all_that_is_included(sources):
    files = sources()
    assert included(files, UNIT) <= set(files)


def test_an_engine_for_records_knows_no_model_and_a_model_no_engine():
    engine = record_engine_sources()
    model = record_model_sources(trace(Thermostat))
    assert not {"model.h", "tables.h", "laws.c", "engine.h"} & set(engine)
    assert not {"record.c", "native.c", "integrate.c", "exponential.c"} & set(model)
    assert set(engine) | set(model) == set(record_sources(trace(Thermostat)))


def test_a_component_with_an_engine_of_its_own_brings_its_files():
    engine = engine_sources(component("rig_proxy"), "native")
    assert {path.parent.name for path in (*engine.sources, *engine.headers)} == {"native"}
    assert all(path.is_file() for path in (*engine.sources, *engine.headers))
    assert engine.libraries["win64"] == ("ws2_32", "winmm")
    plain = engine_sources(Divider, "python")
    assert engine_sources(component("rig_proxy"), "python") == plain, "its slave is in Python"


def test_a_packed_system_has_all_that_is_included_and_nothing_else():
    graph = trace(Divider)
    step, evaluate = packing.Operation("STEP", 0), packing.Operation("EVALUATE", 1)
    program = packing.Program([], [], [step], [evaluate], [])
    places = packing.Places([graph, graph], 0)
    packed = packing.PackedSystem(graph, {"a": graph, "b": graph}, places, program)
    sources = c_sources(graph, PACKED, "{guid}", 2, packed)
    assert included(sources, UNIT) | {UNIT} == set(sources)


def test_one_unit_includes_files_in_order():
    assert unit("b.c", "a.c") == b'#include "b.c"\n#include "a.c"\n'


def test_any_byte_of_any_source_changes_the_key():
    target = toolchain.host_platform()
    sources = c_sources(trace(Divider), engine_sources(Divider, "native"), "{guid}", 2)
    keys = {library_key(sources, ("m",), target), library_key(sources, (), target)}
    keys |= {
        library_key(sources | {name: text + b" "}, ("m",), target) for name, text in sources.items()
    }
    assert len(keys) == 2 + len(sources)
