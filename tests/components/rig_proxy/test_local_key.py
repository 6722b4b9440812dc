"""The key that a server leaves for its clients: who can read it, and which file is believed."""

from __future__ import annotations

import os
import stat

import pytest

from fmus.kit import UserError
from fmus.rig_proxy import local_key
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.keys import left_key
from tests.support.command import posix

ENDPOINT = "tcp://127.0.0.1:5570"


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    """Return the folder of the user's state."""
    monkeypatch.setenv("LOCALAPPDATA" if os.name == "nt" else "XDG_STATE_HOME", str(tmp_path))
    return tmp_path


def test_a_client_finds_it_while_the_server_runs_and_it_is_new_each_time():
    found = []
    for _ in range(2):
        with left_key(ENDPOINT) as holders:
            found.append(local_key.read(ENDPOINT))
            assert holders[found[-1]].role == "acknowledge"
            assert holders[""] == ("", "watch")
        assert local_key.read(ENDPOINT) == ""
    assert found[0] != found[1]
    assert all(len(key) == 32 for key in found)


def test_each_address_and_port_has_its_own():
    places = [ENDPOINT, "tcp://127.0.0.1:5571", "tcp://127.0.0.2:5570", "tcp://[::1]:5570"]
    assert len({local_key.path(place) for place in places}) == len(places)
    assert local_key.path("tcp://localhost:5570") == local_key.path(ENDPOINT)


def test_of_a_name_that_may_have_another_address_the_known_one_is_asked():
    remote = read_endpoint("tcp://localhost:5570")
    addresses = {remote.requests, remote.telemetry, remote.operators}
    assert addresses == {f"tcp://127.0.0.1:{port}" for port in (5570, 5571, 5572)}


@posix
def test_file_and_folder_are_the_users_alone_whatever_was_there(home):
    path = local_key.path(ENDPOINT)
    path.parent.mkdir(parents=True)
    path.parent.chmod(0o777)
    target = home / "elsewhere"
    path.symlink_to(target)
    before = os.umask(0)
    try:
        with left_key(ENDPOINT):
            assert stat.S_IMODE(path.lstat().st_mode) == 0o600
            assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
            assert not path.is_symlink()
    finally:
        os.umask(before)
    assert not target.exists()


@posix
@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o602])
def test_a_file_that_others_can_read_or_write_is_not_believed(mode):
    with left_key(ENDPOINT):
        local_key.path(ENDPOINT).chmod(mode)
        assert local_key.read(ENDPOINT) == ""


@posix
def test_neither_a_link_nor_a_file_of_another_user_is_believed(tmp_path):
    path = local_key.path(ENDPOINT)
    with left_key(ENDPOINT):
        moved = path.rename(tmp_path / "moved")
        path.symlink_to(moved)
        assert local_key.read(ENDPOINT) == ""
        path.unlink()
        moved.rename(path)
        assert local_key.read(ENDPOINT)
        if os.geteuid() != 0:
            pytest.skip("only root can give a file to another user")
        os.chown(path, 65534, -1)
        assert local_key.read(ENDPOINT) == ""


@posix
def test_a_place_that_cannot_be_written_is_told(home):
    (home / "ppy-rig").write_text("")
    with pytest.raises(UserError, match=r"cannot leave the key in .*--no-keys"), left_key(ENDPOINT):
        pass
