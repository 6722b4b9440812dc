"""What the tests share: FMUs built once, and the folder of public records."""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # two workers on two cores; before numpy is loaded

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from fmus import COMPONENTS, component
from fmus.kit.build import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform

pytest.register_assert_rewrite("tests.contract", "tests.support")  # their assertions explain themselves, too
PUBLIC_DATA = Path(os.environ.get("PPY_PUBLIC_DATA", Path(__file__).parents[2] / "shared" / "data"))


@pytest.fixture(scope="session")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], Path]:
    """Path of a component's FMU for this platform, built once a session: ``fmu(name, runtime)``."""
    folder = tmp_path_factory.mktemp("fmus")

    def path(name: str, runtime: str) -> Path:
        file = folder / runtime / f"{name}.fmu"
        if not file.exists():
            file.parent.mkdir(exist_ok=True)
            file.write_bytes(build(component(name), runtime, [host_platform()]))
        return file

    return path


@pytest.fixture(params=RUNTIMES)
def runtime(request: pytest.FixtureRequest) -> str:
    """Each of the two builds in turn."""
    return request.param


@pytest.fixture(params=COMPONENTS)
def name(request: pytest.FixtureRequest) -> str:
    """Each component in turn."""
    return request.param


@pytest.fixture
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files, for this test alone."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture(scope="session")
def browser() -> str:
    """Path of a browser; skips where there is none."""
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    for path in filter(None, map(shutil.which, names)):
        return path
    pytest.skip(f"no browser here: none of {', '.join(names)} is installed")


@pytest.fixture(scope="session")
def public_data() -> Callable[[str], Path]:
    """Path of a public record; skips where it is absent."""

    def path(name: str) -> Path:
        file = PUBLIC_DATA / name
        if not file.exists():
            pytest.skip(f"public record {name} is not in {PUBLIC_DATA} (set PPY_PUBLIC_DATA)")
        return file

    return path
