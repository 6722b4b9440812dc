"""Archives that something was changed in."""

import re
import sys
import zipfile
from pathlib import Path

import pytest

LINUX_BINARY = "binaries/linux64/ppy_actuator.so"
on_linux = pytest.mark.skipif(sys.platform != "linux", reason="looks at Linux libraries")


def edited(source, target, edit=lambda name, contents: (name, contents)):
    """A copy of an archive with other names or contents; None leaves a file out."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            changed = edit(name, old.read(name))
            if changed is not None:
                new.writestr(*changed)
    return target


def anonymous(name, contents):
    """Of a file of an FMU of ours, for `edited`: it does not tell what it was made from."""
    return name, contents.replace(b'"ppy-rig"', b'"another-tool"')


def of_other_laws(name, contents):
    """Of a file of an FMU of ours, for `edited`: the digest of its laws is another."""
    return name, re.sub(rb'laws="[0-9a-f]{64}"', b'laws="0"', contents)


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def flipped(path: Path, member: str) -> bytes:
    """The archive with one byte of a member's compressed data inverted."""
    data = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        entry = archive.getinfo(member)
    data[entry.header_offset + 30 + len(member) + entry.compress_size // 2] ^= 0xFF
    return bytes(data)
