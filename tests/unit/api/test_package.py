"""Claims: the package says its version, and its error is the one that its functions raise."""

from __future__ import annotations

import re
from importlib.metadata import version
from importlib.resources import files

import pytest

import orchestration as ppy


def test_the_version_is_that_of_the_distribution():
    assert ppy.__version__ == version("ppy-rig")
    assert re.fullmatch(r"\d+\.\d+\.\d+\w*", ppy.__version__)


def test_its_error_is_what_functions_raise():
    with pytest.raises(ppy.UserError, match="no component named 'ppy_actuatr'"):
        ppy.find_model("ppy_actuatr")


def test_its_names_are_the_public_ones_and_its_types_are_checked():
    """Also after modules of the package have been imported, which Python makes attributes of it."""
    import orchestration.cli.app  # noqa: F401

    assert dir(ppy) == sorted(ppy.__all__)
    assert not any(name in dir(ppy) for name in ("api", "cli", "fmu", "lazy_loader"))
    for package in ("orchestration", "ppy_rig", "fmus"):
        assert files(package).joinpath("py.typed").is_file()
