"""A file system so small that it fills, for tests of what happens then."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

# Mounts a small disk, says so, and takes it away when its standard input ends, which it does with
# this process however that ends; of no signal of the terminal it knows anything.
KEEPER = """
trap '' INT TERM HUP
mount -t tmpfs -o size=64k tmpfs "$1" || exit 1
echo mounted
cat > /dev/null
umount -l "$1"
"""


@contextlib.contextmanager
def disk_of_64_kib(folder: Path) -> Iterator[Path]:
    """Have a small disk in a folder while the context lasts, and no longer whatever becomes of this
    process.
    """
    if sys.platform != "linux" or shutil.which("mount") is None:
        pytest.skip("a small disk is made with mount of Linux")
    folder.mkdir()
    with subprocess.Popen(
        ["sh", "-c", KEEPER, "keeper", str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as keeper:
        assert keeper.stdin is not None
        assert keeper.stdout is not None
        try:
            if keeper.stdout.readline() != b"mounted\n":
                pytest.skip("this user may not mount a file system")
            yield folder
        finally:
            keeper.stdin.close()
            keeper.wait(30)
    assert not os.path.ismount(folder)
