"""Command of the bridge to OPC UA: what makes no sense is refused before anything is loaded."""

from __future__ import annotations

from pathlib import Path

from tests.support.command import refused

NOBODY = ("--endpoint", "tcp://127.0.0.1:9")


def test_nobody_there_is_a_line(tmp_path: Path) -> None:
    refused(
        tmp_path, "rig", "opcua", *NOBODY, parts=["no answer within 2 s from tcp://127.0.0.1:9"]
    )


def test_beyond_this_machine_nobody_drives(tmp_path: Path) -> None:
    (tmp_path / "password.toml").write_text('password = "long enough"')
    more = ("--password", "password.toml", "--bind", "0.0.0.0")
    refused(tmp_path, "rig", "opcua", *NOBODY, *more, parts=["--bind 0.0.0.0", "127.0.0.1"])


def test_a_password_file_that_is_not_there_is_a_line(tmp_path: Path) -> None:
    refused(tmp_path, "rig", "opcua", *NOBODY, "--password", "none.toml", parts=["none.toml"])
