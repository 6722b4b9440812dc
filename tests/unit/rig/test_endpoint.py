"""Endpoints, as a server and as a client understand them."""

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.endpoint import parse_address, read_endpoint


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("tcp://127.0.0.1:5570", "127.0.0.1", 5570),
        ("tcp://[::1]:1", "[::1]", 1),
        ("tcp://*:0", "*", 0),
    ],
)
def test_host_and_port(text, host, port):
    assert parse_address(text) == (host, port)


@pytest.mark.parametrize(
    "text", ["127.0.0.1:5570", "ipc://x", "tcp://host", "tcp://host:123456", "tcp://::1:5570"]
)
def test_what_is_no_endpoint_is_none_for_either(text):
    for read in (parse_address, read_endpoint):
        with pytest.raises(UserError, match="write tcp://HOST:PORT"):
            read(text)


@pytest.mark.parametrize("text", ["tcp://*:5570", "tcp://rig-pc:0", "tcp://rig-pc:65535"])
def test_a_client_needs_one_host_and_two_ports(text):
    with pytest.raises(UserError, match="with one host and a port from 1 to 65534"):
        read_endpoint(text)


def test_telemetry_is_one_port_higher():
    assert read_endpoint("tcp://[fe80::1%eth0]:5570").telemetry == "tcp://[fe80::1%eth0]:5571"
