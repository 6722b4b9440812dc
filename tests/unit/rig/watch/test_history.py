"""The page with the history gets what the archive holds, and only where there is one."""

from __future__ import annotations

import http.client
import json
import threading
from contextlib import contextmanager

import pytest

from orchestration.rig.watch import Feed, PageServer
from tests.support.rig.archived import AHEAD, filled, samples, voltage


@contextmanager
def served(archive):
    with PageServer(0, "tcp://127.0.0.1:1", Feed(), dict, archive) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def get(server, path):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    try:
        connection.request("GET", path)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()
    finally:
        connection.close()


def test_the_archive_is_sent_as_numbers_over_wall_time(tmp_path):
    archive = filled(tmp_path, samples([*range(1, 60), *range(80, 101)]))
    archive.add("events", [(1, 0.5, "state", "running")], AHEAD)
    with served(tmp_path) as server:
        assert 'src="/history.js"' in get(server, "/history")[1]
        assert get(server, "/history.js")[0] == 200
        status, text = get(server, "/archive")
        zoomed = json.loads(get(server, f"/archive?from={AHEAD + 0.9:f}&to={AHEAD + 0.95:f}")[1])
        empty = json.loads(get(server, f"/archive?from={AHEAD + 0.62:f}&to={AHEAD + 0.7:f}")[1])
    whole = json.loads(text)
    assert status == 200
    assert whole["span"] == whole["whole"] == pytest.approx([AHEAD + 0.01, AHEAD + 1.0], abs=1e-5)
    current, measured = whole["signals"]
    assert (current["name"], current["unit"], current["role"]) == ("current", "A", "inputs")
    expected = [voltage(k) for k in (*range(1, 60), *range(80, 101)) if k % 10]
    assert measured["low"] == measured["high"] == expected  # fewer samples than parts
    assert [(gap["lost"], gap["reason"]) for gap in whole["gaps"]] == [(20, "lost")]
    assert [event["text"] for event in whole["events"]] == ["running"]
    assert zoomed["signals"][1]["low"] == [voltage(k) for k in range(91, 96)]
    assert zoomed["events"] == []
    assert [signal["time"] for signal in empty["signals"]] == [[], []]
    assert [gap["lost"] for gap in empty["gaps"]] == [20]


def test_other_questions_are_refused_in_a_line(tmp_path):
    with served(tmp_path) as server:
        assert get(server, "/archive?from=x&to=1")[0] == 400
        status, text = get(server, "/archive")
        assert status == 404
        assert "holds no samples" in json.loads(text)["error"]
    with served(None) as server:
        assert get(server, "/archive")[0] == get(server, "/history")[0] == 404
        assert "<p hidden>" in get(server, "/")[1]
