"""Endpoints, as a server and as a client understand them."""

import pytest
import zmq

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


@pytest.mark.parametrize("text", ["tcp://*:5570", "tcp://rig-pc:0", "tcp://rig-pc:65534"])
def test_a_client_needs_one_host_and_three_ports(text):
    with pytest.raises(UserError, match="with one host and a port from 1 to 65533"):
        read_endpoint(text)


def test_telemetry_and_operators_have_the_next_ports():
    endpoint = read_endpoint("tcp://[fe80::1%eth0]:5570")
    assert endpoint.telemetry == "tcp://[fe80::1%eth0]:5571"
    assert endpoint.operators == "tcp://[fe80::1%eth0]:5572"


def test_a_connection_has_a_name():
    with zmq.Context() as context, context.socket(zmq.DEALER) as socket:
        endpoint = read_endpoint("tcp://127.0.0.1:5999")
        endpoint.connect(socket, endpoint.requests)
        assert socket.routing_id.startswith(b"ppy-")
