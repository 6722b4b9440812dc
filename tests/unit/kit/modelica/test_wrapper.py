"""Claims: a wrapper has the interface of its model, and its external functions run the FMU."""

import ctypes
import re
from ctypes import POINTER, c_char_p, c_double, c_int, c_size_t, c_void_p
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave

import fmus
from fmus.kit.build import build_cached
from fmus.kit.build.toolchain import compile_library, host_platform
from fmus.kit.modelica import class_name, package_files
from tests.support.kit_samples import Thermostat
from tests.support.modelica import parse_by_pymoca, write
from tests.support.pace import slow_but

C = Path(__file__).parents[3] / "support" / "c" / "modelica"
CLASSES = [fmus.component("galvanostat"), fmus.component("foot"), Thermostat]
STEP = 0.005


@pytest.fixture(scope="module")
def files():
    archives = {cls.name: build_cached(cls, "native").read_bytes() for cls in CLASSES}
    return package_files(CLASSES, "0", archives)


@pytest.fixture(scope="module")
def library(files, tmp_path_factory):
    """The external functions, compiled with the header in the package's own folder."""
    folder = tmp_path_factory.mktemp("wrappers")
    write(files, folder)
    include = folder / "PpyRig" / "Resources" / "Include"
    compiled = compile_library(
        [C / "external_object.c"], [include, C], host_platform(), libraries=["dl"]
    )
    path = folder / "external_object"
    path.write_bytes(compiled)
    loaded = ctypes.CDLL(str(path))
    loaded.last_error.restype = c_char_p
    loaded.open_fmu.restype = c_void_p
    loaded.open_fmu.argtypes = [c_char_p, c_char_p, c_char_p, c_int, POINTER(c_double), c_size_t]
    loaded.communicate.argtypes = [
        c_void_p,
        c_double,
        POINTER(c_double),
        c_size_t,
        POINTER(c_int),
        c_size_t,
        POINTER(c_double),
    ]
    loaded.close_fmu.argtypes = [c_void_p]
    return loaded


def doubles(values):
    return (c_double * len(values))(*values)


def arguments(files, cls):
    """Name, GUID, types and place of the first input, as the wrapper's text gives them."""
    text = files[f"PpyRig/FMUs/{class_name(cls.name)}.mo"].decode()
    found = re.search(r'Instance\("(\w+)", "([^"]+)", "(\w+)", (\d+),', text)
    outputs = re.search(r"\{([\d,\s]+)\}\);", text)[1]
    return [*(part.encode() for part in found.groups()[:3]), int(found[4])], [
        int(place) for place in outputs.split(",")
    ]


def by_fmpy(cls, courses, times):
    """Hold inputs between communication points; outputs with those of the point."""
    path = build_cached(cls, "native")
    description = fmpy.read_model_description(path)
    references = {v.name: v.valueReference for v in description.modelVariables}
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(path),
        modelIdentifier=cls.name,
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    rows = []
    for k, time in enumerate(times):
        for v, value in zip(cls.layout.inputs, courses[k], strict=True):
            if v.type == "real":
                fmu.setReal([references[v.name]], [float(value)])
            else:
                fmu.setBoolean([references[v.name]], [bool(value)])
        if k == 0:
            fmu.exitInitializationMode()
        getters = {"real": fmu.getReal, "integer": fmu.getInteger, "boolean": fmu.getBoolean}
        rows.append([float(getters[v.type]([references[v.name]])[0]) for v in cls.layout.shown])
        if k + 1 < len(times):
            fmu.doStep(time, times[k + 1] - time)
    fmu.terminate()
    fmu.freeInstance()
    return np.array(rows)


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.name)
def test_external_functions_give_the_bits_of_the_fmu(cls, files, library):
    times = STEP * np.arange(60)
    inputs = cls.layout.inputs
    courses = np.array(
        [
            [
                float(t > 0.12)
                if v.type == "boolean"
                else v.start + v.nominal * np.sin(9.0 * t + k)
                for k, v in enumerate(inputs)
            ]
            for t in times
        ]
    )
    opening, outputs = arguments(files, cls)
    parameters = [float(p.start) for p in cls.layout.parameters]
    fmu = library.open_fmu(*opening, doubles(parameters), len(parameters))
    assert fmu, library.last_error()
    rows = []
    values = doubles([0.0] * len(outputs))
    places = (c_int * len(outputs))(*outputs)
    for time, row in zip(times, courses, strict=True):
        for _ in range(2):  # an event may be iterated
            assert library.communicate(
                fmu, time, doubles(row), len(row), places, len(outputs), values
            ), library.last_error()
        rows.append(list(values))
    library.close_fmu(fmu)
    assert (np.array(rows) == by_fmpy(cls, courses, times)).all()
    assert np.ptp(rows, axis=0).max() > 0.0


def test_what_fails_is_told_by_the_fmu(files, library):
    opening, _ = arguments(files, CLASSES[0])
    parameters = [float(p.start) for p in CLASSES[0].layout.parameters]
    assert not library.open_fmu(b"absent", *opening[1:], doubles(parameters), len(parameters))
    assert library.last_error().startswith(b"absent: no library in Resources/Library/")
    wrong = [opening[0], b"{wrong}", *opening[2:]]
    assert not library.open_fmu(*wrong, doubles(parameters), len(parameters))
    assert library.last_error().startswith(b"galvanostat: ")
    assert b"GUID" in library.last_error()
    fmu = library.open_fmu(*opening, doubles([-1.0, *parameters[1:]]), len(parameters))
    values = doubles([0.0])
    assert not library.communicate(fmu, 0.0, doubles([0.0] * 4), 4, (c_int * 1)(0), 1, values)
    assert b"current_limit" in library.last_error()
    library.close_fmu(fmu)


@pytest.mark.parametrize("cls", slow_but(CLASSES, CLASSES[0], CLASSES[2]), ids=lambda cls: cls.name)
def test_the_interface_is_that_of_the_model(cls, files):
    package = parse_by_pymoca(files).classes["PpyRig"]
    name = class_name(cls.name)
    own, wrapped = (
        {n for n, symbol in classes[name].symbols.items() if is_public(symbol)}
        for classes in (package.classes, package.classes["FMUs"].classes)
    )
    states = {s.name for s in (*cls.layout.states, *cls.layout.discretes)}
    inside = states - {v.name for v in cls.layout.shown}
    assert wrapped == own - inside | {"communication_step"}


def is_public(symbol):
    return symbol.visibility.name != "PROTECTED"
