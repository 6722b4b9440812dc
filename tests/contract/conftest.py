"""FMUs for the contract: every component in both builds, and the small models beside them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.component import Component
from tests.contract.raw import instance
from tests.contract.subjects import SUBJECTS, Subject


@pytest.fixture(autouse=True)
def _linux_only() -> None:
    if sys.platform == "win32":
        pytest.skip("an unzipped FMU cannot be removed while its library is loaded")


@pytest.fixture
def archive(fmu: Callable[[str, str], Path], name: str, runtime: str) -> Path:
    """Path of each component's FMU in each build."""
    return fmu(name, runtime)


@pytest.fixture
def one(archive: Path):
    """Open a fresh instance of each."""
    with instance(archive) as created:
        yield created


@pytest.fixture
def subject(name: str) -> Subject:
    """Return the typical values that tests need of the component."""
    return SUBJECTS[name]


@pytest.fixture
def load(name: str) -> str:
    """Name of the mechanical input of an actuator."""
    return SUBJECTS[name].second


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Callable[[type[Component], str], Path]:
    """Build the FMU of any class once a session: ``built(cls, runtime)`` returns its path."""
    folder = tmp_path_factory.mktemp("models")
    places: dict[tuple[type[Component], str], Path] = {}  # two classes may have one name

    def path(cls: type[Component], runtime: str) -> Path:
        if (cls, runtime) not in places:
            file = folder / str(len(places)) / f"{cls.name}.fmu"
            file.parent.mkdir()
            file.write_bytes(build(cls, runtime, [host_platform()]))
            places[cls, runtime] = file
        return places[cls, runtime]

    return path
