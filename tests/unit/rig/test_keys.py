"""Keys of a rig: made once, readable by their owner alone, and refused in one line if malformed."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest
import zmq

from fmus.kit.errors import UserError
from fmus.rig_proxy.credentials import read_client_keys
from orchestration.rig.keys import (
    ROLES,
    KeyFile,
    KeyHolder,
    add_client,
    make_keys,
    read_server_keys,
)
from tests.support.command import here, posix, refused


def public_of(secret: str) -> str:
    return zmq.curve_public(secret.encode()).decode()


def test_a_pair_for_the_server_and_one_for_its_client(tmp_path):
    server_file, client_file = make_keys(tmp_path / "keys")
    server, client = read_server_keys(server_file), read_client_keys(client_file)
    assert public_of(server.secret_key) == server.public_key == client.server_key
    assert public_of(client.secret_key) == client.public_key
    assert server.clients == {client.public_key: ("first-client", "acknowledge")}
    assert server.secret_key != client.secret_key


@posix
def test_nobody_else_can_read_them(tmp_path):
    before = os.umask(0)
    try:
        files = [*make_keys(tmp_path), add_client(tmp_path, "lab")]
    finally:
        os.umask(before)
    assert [stat.S_IMODE(path.stat().st_mode) for path in files] == [0o600] * 3
    assert (
        stat.S_IMODE((tmp_path / "rig-server.toml").stat().st_mode) == 0o600
    )  # which was written anew


@posix
@pytest.mark.parametrize("mode", [0o644, 0o640, 0o604])
def test_a_file_that_others_can_read_is_told(tmp_path, mode):
    server, client = make_keys(tmp_path)
    for path, read in ((server, read_server_keys), (client, read_client_keys)):
        told: list[str] = []
        read(path, told.append)
        assert told == []
        path.chmod(mode)
        read(path, told.append)
        assert len(told) == 1
        assert str(path) in told[0]
        assert "read by others" in told[0]


def test_one_more_client(tmp_path):
    server_file, first = make_keys(tmp_path)
    second, third = add_client(tmp_path, "lab"), add_client(tmp_path, "my-2nd_PC", "watch")
    server, clients = (
        read_server_keys(server_file),
        [read_client_keys(path) for path in (first, second, third)],
    )
    assert server.clients == {
        clients[0].public_key: ("first-client", "acknowledge"),
        clients[1].public_key: ("lab", "command"),
        clients[2].public_key: ("my-2nd_PC", "watch"),
    }
    assert {client.server_key for client in clients} == {server.public_key}
    assert {path.name for path in tmp_path.iterdir()} == {
        "rig-server.toml",
        "rig-client.toml",
        "rig-client-lab.toml",
        "rig-client-my-2nd_PC.toml",
    }


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_nothing_is_overwritten(tmp_path):
    make_keys(tmp_path)
    add_client(tmp_path, "lab")
    before = contents(tmp_path)
    for again in (lambda: make_keys(tmp_path), lambda: add_client(tmp_path, "lab")):
        with pytest.raises(UserError, match="overwritten"):
            again()
        assert contents(tmp_path) == before


@pytest.mark.parametrize("present", ["rig-server.toml", "rig-client.toml"])
def test_half_a_pair_is_not_made_whole(tmp_path, present):
    (tmp_path / present).write_text("mine")
    with pytest.raises(UserError, match=present):
        make_keys(tmp_path)
    assert contents(tmp_path) == {present: b"mine"}


def test_two_at_once_do_not_lose_a_client(tmp_path):
    make_keys(tmp_path)
    (tmp_path / "rig-server.toml.part").write_text("")  # another one is at work
    before = contents(tmp_path)
    with pytest.raises(UserError, match=r"rig-server\.toml\.part"):
        add_client(tmp_path, "lab")
    assert contents(tmp_path) == before


@pytest.mark.parametrize("name", ["", "../x", "a b", "-x", "ü", "x" * 41, "a/b"])
def test_names_that_are_no_file_names(tmp_path, name):
    make_keys(tmp_path)
    with pytest.raises(UserError, match="--client"):
        add_client(tmp_path, name)


def test_a_role_that_there_is_not(tmp_path):
    make_keys(tmp_path)
    before = contents(tmp_path)
    with pytest.raises(UserError, match="--role 'root': there are watch, command, acknowledge"):
        add_client(tmp_path, "lab", "root")
    assert contents(tmp_path) == before


def test_a_role_has_those_below_it():
    holders = [KeyHolder("x", role) for role in ("", "watch", "command", "acknowledge")]
    allowed = [[holder.has_role(role) for role in ROLES] for holder in holders]
    assert allowed == [[False] * 3, [True, False, False], [True, True, False], [True] * 3]


def test_a_client_needs_a_server(tmp_path):
    with pytest.raises(UserError, match="there is no such key file"):
        add_client(tmp_path, "lab")


GOOD = "rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7"  # from the specification of ZMQ CURVE's examples


@pytest.mark.parametrize(
    ("clients", "why"),
    [
        ("5", "clients must be"),
        ('["x"]', r"clients\[0\] must be \{ key"),
        ("[{}]", r"clients\[0\]: name None has to be 1 to 40"),
        ('[{name = "a b"}]', r"name 'a b' has to be"),
        ('[{name = "a"}]', "role None; there are watch, command, acknowledge"),
        ('[{name = "a", role = "root"}]', "role 'root'; there are watch"),
        ('[{name = "a", role = "watch"}]', r"clients\[0\]: key must be a text"),
        ('[{name = "a", role = "watch", key = "x"}]', r"clients\[0\]: key has 1"),
    ],
)
def test_clients_of_a_server_are_keys(tmp_path, clients, why):
    path = tmp_path / "server.toml"
    path.write_text(f'public_key = "{GOOD}"\nsecret_key = "{GOOD}"\nclients = {clients}')
    with pytest.raises(UserError, match=why):
        read_server_keys(path)


def test_a_file_that_has_changed_is_read_again_and_a_broken_one_changes_nothing(tmp_path):
    server_file, _ = make_keys(tmp_path / "ours")
    told: list[str] = []
    file = KeyFile(server_file, told.append)

    def names() -> set[str]:
        return {holder.name for holder in file.clients().values()}

    assert names() == {"first-client"}
    add_client(server_file.parent, "lab")
    assert names() == {"first-client", "lab"}
    assert told == ["keys read again: let in lab (command); shut out nobody"]
    whole = server_file.read_text()
    stranger, _ = make_keys(tmp_path / "theirs")
    for broken, why in (("clients = [", "not TOML"), (stranger.read_text(), "another server")):
        server_file.write_text(broken)
        assert names() == {"first-client", "lab"}
        assert why in told[-1]
        assert told[-1].endswith("the keys read before hold on")
    number = len(told)
    assert names() == {"first-client", "lab"}
    assert len(told) == number, "it is told once"
    server_file.unlink()
    assert names() == {"first-client", "lab"}
    server_file.write_text("\n".join(row for row in whole.splitlines() if '"lab"' not in row))
    server_file.chmod(0o600)
    assert names() == {"first-client"}
    assert told[-1] == "keys read again: let in nobody; shut out lab (command)"


def test_secrets_are_not_shown(tmp_path):
    server_file, client_file = make_keys(tmp_path)
    for keys in (read_server_keys(server_file), read_client_keys(client_file)):
        assert keys.secret_key not in repr(keys)


def test_on_the_command_line(tmp_path):
    done = here("rig", "keys", "keys", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert here("rig", "keys", "keys", "--client", "lab", cwd=tmp_path).returncode == 0
    assert here("rig", "keys", "keys", "--client", "page", "--role", "watch", cwd=tmp_path)
    clients = read_server_keys(tmp_path / "keys" / "rig-server.toml").clients.values()
    assert [tuple(holder) for holder in clients] == [
        ("first-client", "acknowledge"),
        ("lab", "command"),
        ("page", "watch"),
    ]
    refused(tmp_path, "rig", "keys", "keys", "--role", "watch", parts=["--role", "--client"])
    refused(tmp_path, "rig", "keys", "keys", parts=["rig-server.toml", "not overwritten"])
    refused(tmp_path, "rig", "keys", "nowhere", "--client", "lab", parts=["rig-server.toml"])
