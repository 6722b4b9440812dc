"""Claims: only the page itself, from this machine and by its own name, sees the rig and can stop
it.
"""

from __future__ import annotations

import json
import re
import socket
import threading
import time
from contextlib import ExitStack, closing
from http.client import HTTPConnection

import pytest

from fmus.kit import UserError
from orchestration.rig.watch.feed import Feed
from orchestration.rig.watch.serve import PageServer

STATUS = {
    "state": "stopping",
    "reason": "stop pressed",
    "latch": "a1",
    "reached": None,
    "alarm": "",
    "clock": 10.0,
    "client": "",
    "mode": "real-time",
    "period": 0.02,
    "watchdog": 0.2,
    "limits": {},
    "inputs": {"current": "A"},
    "outputs": {"voltage": "V"},
}


@pytest.fixture
def page():
    """A server of the page; `stops` has what its button did."""
    stops = []

    def stop():
        stops.append("stop")
        if len(stops) > 1:
            raise UserError("no answer within 1 s")
        return STATUS

    server = PageServer(0, "tcp://rig:5570", Feed(), stop)
    server.stops = stops
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def ask(page, method, path, headers=()):
    with closing(HTTPConnection("127.0.0.1", page.port, timeout=5)) as connection:
        connection.request(method, path, headers=dict(headers))
        answer = connection.getresponse()
        return answer.status, answer.read().decode(), answer.headers


def test_the_page_is_of_this_rig_and_takes_nothing_from_elsewhere(page):
    status, text, headers = ask(page, "GET", "/")
    assert (status, page.address) == (200, f"http://127.0.0.1:{page.port}/")
    assert "tcp://rig:5570" in text
    assert re.search(r'name="rig-token" content="(.+?)"', text)[1] == page.token
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert headers["Cache-Control"] == "no-store"
    assert "worker-src 'self'" in headers["Content-Security-Policy"]
    for name, kind in (("page.css", "text/css"), ("worker.js", "text/javascript")):
        status, _, headers = ask(page, "GET", f"/{name}")
        assert (status, headers["Content-Type"]) == (200, f"{kind}; charset=utf-8")


def test_connections_that_say_nothing_leave_room_for_a_stop(page):
    with ExitStack() as opened:
        connections = [
            opened.enter_context(socket.create_connection(("127.0.0.1", page.port), timeout=5))
            for _ in range(300)
        ]
        assert [connection.recv(1) for connection in connections[:150]] == 150 * [b""]
        assert len(page._connections) <= 100
        status, _, _ = ask(page, "POST", "/stop", {"X-Rig-Token": page.token}.items())
        assert (status, page.stops) == (200, ["stop"])


@pytest.mark.parametrize("path", ["/page.html", "/serve.py", "/../serve.py", "//etc/passwd"])
def test_no_other_file_is_served(page, path):
    assert ask(page, "GET", path)[0] == 404


def test_the_button_of_the_page_stops_the_rig_and_says_how_far_that_is(page):
    own = {"X-Rig-Token": page.token, "Origin": page.address.rstrip("/")}
    status, text, _ = ask(page, "POST", "/stop", own)
    answer = json.loads(text)
    assert status == 200
    assert (answer["state"], answer["reached"], answer["alarm"]) == ("stopping", None, "")
    assert answer["serial"] == page.feed.since(-1).serial
    status, text, _ = ask(page, "POST", "/stop", own)
    assert (status, json.loads(text)) == (504, {"error": "no answer within 1 s"})
    assert page.stops == ["stop", "stop"]
    told = [item["text"] for item in page.feed.since(-1).items if item["kind"] == "event"]
    assert not any("confirmed" in text for text in told)


@pytest.mark.parametrize(
    ("headers", "path", "status"),
    [
        ({"X-Rig-Token": "x"}, "/stop", 403),
        ({}, "/stop", 403),
        ({"Origin": "https://evil.example"}, "/stop", 403),
        ({"Host": "evil.example"}, "/stop", 403),
        ({}, "/acknowledge", 404),
    ],
)
def test_nobody_else_stops_it_and_nothing_else_is_commanded(page, headers, path, status):
    token = {} if not headers and path == "/stop" else {"X-Rig-Token": page.token}
    assert ask(page, "POST", path, token | headers)[0] == status
    assert page.stops == []


EVERYTHING = ("/", "/stream?after=-1", "/page.js", "/worker.js", "/page.css", "/stop", "/none")


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Origin": "https://evil.example"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},  # another port of this machine
        {"Sec-Fetch-Site": "anything"},
    ],
)
def test_nothing_is_served_to_another_site(page, headers):
    for path in EVERYTHING:
        for method in ("GET", "POST"):
            assert ask(page, method, path, {"X-Rig-Token": page.token, **headers})[0] == 403
    assert page.stops == []


def test_the_page_itself_its_user_and_other_programs_are_served(page):
    for headers in ({}, {"Sec-Fetch-Site": "same-origin"}, {"Sec-Fetch-Site": "none"}):
        for path in EVERYTHING[:5]:
            assert ask(page, "GET", path, headers)[0] == 200


def test_the_stream_is_answered_at_once_with_what_the_page_misses(page):
    page.feed.event("rig", "before")
    first = json.loads(ask(page, "GET", "/stream?after=-1")[1])
    assert (first["first"], first["instance"]) == (True, page.instance)
    assert "before" in json.dumps(first["items"])
    page.feed.event("rig", "after")
    then = json.loads(ask(page, "GET", f"/stream?after={first['serial']}")[1])
    assert not then["first"]
    assert [item["text"] for item in then["items"]] == ["after"]
    assert first["now"] <= then["now"] <= time.monotonic()
    began = time.monotonic()
    nothing = json.loads(ask(page, "GET", f"/stream?after={then['serial']}")[1])
    assert nothing["items"] == []
    assert time.monotonic() - began < 1.0


@pytest.mark.parametrize("query", ["", "?after=", "?after=x", "?after=-2", "?after=1&b=2", "?a=1"])
def test_a_stream_from_nowhere_is_refused(page, query):
    assert ask(page, "GET", f"/stream{query}")[0] == 400


def test_a_port_that_is_taken_is_told_with_what_to_do():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(UserError, match=f"127.0.0.1:{port}.*--port chooses another one"):
            PageServer(port, "any", Feed(), dict)
