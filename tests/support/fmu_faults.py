"""FMUs with one fault, and whether the check finds it."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from pathlib import Path

from orchestration.fmu.check import Finding, check_fmu
from tests.support.archive import contents

Change = Callable[[dict[str, bytes]], None]


def lines(findings: list[Finding], *severities: str) -> list[str]:
    return [f"{f.line} {f.severity}: {f.message}" for f in findings if f.severity in severities]


def packed(folder: Path, files: dict[str, bytes]) -> Path:
    path = folder / "changed.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data)
    return path


def text(old: str, new: str) -> Change:
    """Replace text, which must be there, in the model description."""

    def change(files: dict[str, bytes]) -> None:
        before = files["modelDescription.xml"].decode()
        assert old in before
        files["modelDescription.xml"] = before.replace(old, new, 1).encode()

    return change


def pattern(old: str, new: str) -> Change:
    def change(files: dict[str, bytes]) -> None:
        after, count = re.subn(old, new, files["modelDescription.xml"].decode(), flags=re.S)
        assert count
        files["modelDescription.xml"] = after.encode()

    return change


def drop(prefix: str) -> Change:
    def change(files: dict[str, bytes]) -> None:
        doomed = [name for name in files if name.startswith(prefix)]
        assert doomed
        for name in doomed:
            del files[name]

    return change


def put(name: str, data: bytes) -> Change:
    return lambda files: files.update({name: data})


def check_that_fault_is_found(path: Path, folder: Path, change: Change, expected: str) -> None:
    """Change a good FMU; a line about it must match the pattern."""
    files = contents(path)
    change(files)
    found = lines(check_fmu(packed(folder, files)), "error", "warning", "note")
    assert any(re.match(expected, line) for line in found), "\n".join(found)
    assert not any("\n" in line for line in found)
