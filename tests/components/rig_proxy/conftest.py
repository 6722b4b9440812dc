"""The engine of the native build, compiled once, and one of them to a test."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.rig.native_engine import NativeEngine, build_driver


@pytest.fixture(scope="session")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program around the engine."""
    return build_driver(tmp_path_factory.mktemp("driver"))


@pytest.fixture
def engine(driver: Path) -> Iterator[NativeEngine]:
    """An engine, which the sanitizers look after until it is freed."""
    made = NativeEngine(driver)
    yield made
    made.close()
