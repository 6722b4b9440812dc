"""FMUs of a package whose laws are others than those here, as an earlier one built them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import fmus

_BUILD = """
import sys
import fmus
from fmus.kit import stack
from fmus.kit.build import build
from fmus.kit.build.toolchain import host_platform

package, out, runtime, fmi, *names = sys.argv[1:]
assert fmus.__file__.startswith(package), fmus.__file__
cls = fmus.component("ppy_actuator")
if names:
    cls = stack(cls, *(fmus.effects("ppy_actuator")[name] for name in names))
with open(out, "wb") as file:
    file.write(build(cls, runtime, [host_platform()], fmi=int(fmi)))
"""


def package_with(folder: Path, file: str = "", old: str = "", new: str = "") -> Path:
    """Return the folder of a copy of the package, in one file of which a text is another."""
    shutil.copytree(
        Path(fmus.__file__).parent, folder / "fmus", ignore=shutil.ignore_patterns("__pycache__")
    )
    if file:
        path = folder / "fmus" / file
        text = path.read_text("utf-8")
        assert text.count(old) == 1
        path.write_text(text.replace(old, new), "utf-8")
    return folder


def built_by(
    package: Path, out: Path, effects: Sequence[str] = (), runtime: str = "native", fmi: int = 2
) -> Path:
    """Build the actuator with effects in a process that has another package; return the file."""
    arguments = [str(package), str(out), runtime, str(fmi), *effects]
    environment = {**os.environ, "PYTHONPATH": str(package)}
    # not in this folder, whose package would come first
    subprocess.run(
        [sys.executable, "-c", _BUILD, *arguments], env=environment, cwd=package, check=True
    )
    return out
