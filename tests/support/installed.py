"""A distribution in a folder, as an installer leaves it, without an installer."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

OTHER_COMPONENTS = Path(__file__).with_name("other_components")


def install(source: Path, site: Path) -> dict[str, str]:
    """Copy the packages of a distribution to a folder, with the metadata of its pyproject.toml.

    Parameters
    ----------
    source : Path
        Folder of the distribution.
    site : Path
        Where it goes.

    Returns
    -------
    dict of str to str
        Environment in which Python finds it.
    """
    text = (source / "pyproject.toml").read_text(encoding="utf-8")
    settings = tomllib.loads(text)
    project = settings["project"]
    for package in settings["tool"]["setuptools"]["packages"]:
        unwanted = shutil.ignore_patterns("__pycache__")
        shutil.copytree(source / package, site / package, ignore=unwanted, dirs_exist_ok=True)
    folder = site / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    folder.mkdir(parents=True)
    head = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    (folder / "METADATA").write_text(head, encoding="utf-8")
    lines = []
    for group, entries in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in entries.items())]
    (folder / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")
    return {"PYTHONPATH": str(site)}
