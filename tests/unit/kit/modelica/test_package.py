"""Claims: a package is a folder as the language wants it, and names what it cannot hold."""

import re

import pytest

import fmus
from fmus.kit import UserError
from fmus.kit.modelica import PACKAGE, package_files
from tests.support.kit_samples import Divider, Thermostat


def texts():
    files = package_files([Thermostat, Divider], "1.2.3")
    return {path: contents.decode() for path, contents in files.items()}


FILES = texts()


def test_every_class_is_in_a_file_of_its_name_that_says_where_it_is():
    for path, text in FILES.items():
        *folders, file = path.split("/")
        if file == "package.order" or "Resources" in folders:
            continue
        within, second = text.splitlines()[:2]
        packages = folders[:-1] if file == "package.mo" else folders
        name = folders[-1] if file == "package.mo" else file.removesuffix(".mo")
        assert within == f"within {'.'.join(packages)};"
        assert re.match(rf"(package|model|block|connector|function) {name}\b", second), path


def test_the_order_names_every_class_once():
    for path, text in FILES.items():
        folder, _, file = path.rpartition("/")
        if file == "package.order":
            files = [p for p in FILES if p.rpartition("/")[0] == folder and p.endswith(".mo")]
            named = {p.rpartition("/")[2].removesuffix(".mo") for p in files} - {"package"}
            subfolders = {
                p[len(folder) + 1 :].split("/")[0] for p in FILES if p.startswith(f"{folder}/")
            }
            named |= {s for s in subfolders if "." not in s and s != "Resources"}
            assert sorted(text.split()) == sorted(named)


def test_it_has_the_version_of_what_made_it():
    assert 'annotation(version="1.2.3");' in FILES[f"{PACKAGE}/package.mo"]


def test_the_same_components_give_the_same_text():
    assert texts() == FILES


def test_a_component_without_laws_is_refused():
    with pytest.raises(UserError, match=r"^rig_proxy: it has an engine in the place of laws"):
        package_files([fmus.component("rig_proxy")], "1")


def test_two_models_of_one_name_are_refused():
    with pytest.raises(UserError, match=r"^divider: there is a model Divider already"):
        package_files([Divider, Divider], "1")
