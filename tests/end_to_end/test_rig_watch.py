"""Claims: the live view shows a rig as it is, says within a second that it cannot, and commands
nothing but stop.
"""

from __future__ import annotations

import http.client
import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

from orchestration.rig.keys import make_keys
from tests.support.browser import chromium
from tests.support.command import posix, refused
from tests.support.rig.driver import PERIOD, Driver
from tests.support.rig.process import ROOT, Server
from tests.support.rig.small_rig import SmallRig, free_port, small_rig_process

pytestmark = pytest.mark.real_time

PROMISED = 1.0  # s until the page says that contact is lost
ALLOWANCE = 1.0  # s more, for a machine on which a browser and other tests compete for two cores
# of the time, in which a busy machine may not let the rig answer; taken for lost it would be a
# third
_STALLS = 0.2
PATIENCE = 15.0  # s, for what takes milliseconds on an idle machine
SHOWN = """(() => { const found = {};
  for (const card of document.querySelectorAll(".card")) {
    const text = place => card.querySelector(place).textContent;
    found[card.dataset.signal] = { value: text(".number"), unit: text(".unit"),
      low: text(".limits :first-child"),
      high: text(".limits :last-child"), badge: text(".badge"), age: text(".age"),
        kind: card.className.trim() };
  }
  return found })()"""
PIXELS = """(signal => { const canvas = document.querySelector(`[data-signal=${signal}] canvas`);
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const found = { forbidden: 0, drawn: 0 };
  for (let k = 0; k < data.length; k += 4) if (data[k + 3]) {
    if (data[k] > 150 && data[k + 1] < 120 && data[k + 2] < 120) found.forbidden++;
    if (data[k + 3] > 200 && data[k + 2] > 130 && data[k] < 60) found.drawn++;
  }
  return found })"""
COLOURS = """(place => {
  let e = [...document.querySelectorAll(place)].find(e => e.textContent && !e.hidden),
    behind = "rgba(0, 0, 0, 0)";
  const ink = getComputedStyle(e).color;
  for (; e && behind === "rgba(0, 0, 0, 0)"; e = e.parentElement)
    behind = getComputedStyle(e).backgroundColor;
  return [ink, behind].map(c => c.match(/[\\d.]+/g).slice(0, 3).map(Number)) })"""
EXPERIMENT = """
component = "ppy_actuator"
duration = "60 s"
step = "0.1 s"
inputs.current = "0 A"
inputs.force = "1.5 N"
"""
BOX = (
    "(r => [r.left, r.top, r.width,"
    " r.height])(document.getElementById('stop').getBoundingClientRect())"
)


@contextmanager
def watching(rig_port, *more):
    """The command in a process of its own; its address."""
    command = [
        sys.executable,
        "-m",
        "orchestration.cli",
        "rig",
        "watch",
        "--no-browser",
        "--port",
        "0",
    ]
    command += ["--endpoint", f"tcp://127.0.0.1:{rig_port}", *map(str, more)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        process.address = re.search(r"at (http://127\.0\.0\.1:\d+/)", process.stdout.readline())[1]
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        process.stderr.close()


@pytest.fixture(scope="module")
def tab(browser, tmp_path_factory):
    with chromium(browser, tmp_path_factory.mktemp("profile")) as tab:
        yield tab


def text(tab, place):
    return tab.run(f"document.getElementById({place!r})?.textContent")


def until(condition, within=PATIENCE):
    """Wait until something is so; returns how long it took."""
    began = time.monotonic()
    while not (found := condition()):
        assert time.monotonic() - began < within, f"not within {within} s"
        time.sleep(0.02)
    return time.monotonic() - began, found


def is_lost(tab):
    return tab.run(
        "document.getElementById('alarm')?.hidden === false && document.body.dataset.state ==="
        " 'lost'"
    )


# --- what is shown
# --------------------------------------------------------------------------------------------------


def test_every_signal_with_unit_limits_and_age(tab):
    with SmallRig() as rig, watching(rig.port) as watch:
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "idle")
        assert (text(tab, "client"), text(tab, "name")) == ("none", rig.endpoint)
        with Driver(rig.endpoint, lambda number: (0.5, 2.0), client="bench PC"):
            until(lambda: text(tab, "state") == "running")
            assert text(tab, "client") == "bench PC"
            _, shown = until(
                lambda: (found := tab.run(SHOWN))["current"]["value"] == "0.500" and found
            )
            assert list(shown) == ["current", "force", "voltage", "displacement"]
            assert {name: (of["value"], of["unit"]) for name, of in shown.items()} == {
                "current": ("0.500", "A"),
                "force": ("2.000", "N"),
                "voltage": ("0.300", "V"),
                "displacement": ("190.0", "µm"),  # 1e-4 * 2 - 2e-5 * 0.5
            }
            assert (shown["current"]["low"], shown["current"]["high"]) == (
                "min −1.3 A",
                "max 1.3 A",
            )
            assert (shown["displacement"]["low"], shown["displacement"]["high"]) == ("", "")
            assert re.fullmatch(r"age \d+ ms", shown["voltage"]["age"])
            assert {of["kind"] for of in shown.values()} == {"card"}
        assert tab.complaints == []
        assert {
            url.startswith(watch.address) or url.startswith("data:") for url in tab.requests
        } == {True}


@pytest.mark.parametrize(
    ("current", "kind", "badge"),
    [
        (1.1, "card", ""),
        (1.28, "card near", "near its limit"),
        (-1.29, "card near", "near its limit"),
    ],
)
def test_a_value_near_its_limit_stands_out(tab, current, kind, badge):
    with (
        SmallRig() as rig,
        watching(rig.port) as watch,
        Driver(rig.endpoint, lambda number: (current, 1.0)),
    ):
        tab.open(watch.address, 1280)
        until(
            lambda: (
                tab.run(SHOWN).get("current", {}).get("value") == f"{current:.3f}".replace("-", "−")
            )
        )
        shown = tab.run(SHOWN)
        assert (shown["current"]["kind"], shown["current"]["badge"]) == (kind, badge)
        assert shown["force"]["kind"] == "card"


def test_a_measured_value_beyond_its_limit_stands_out(tab):
    with (
        SmallRig(plant=lambda inputs, now: {"voltage": -1.001, "displacement": 1e-3}) as rig,
        watching(rig.port) as watch,
    ):
        tab.open(watch.address, 1280)
        until(lambda: tab.run(SHOWN).get("voltage", {}).get("kind") == "card beyond")
        assert tab.run(SHOWN)["voltage"]["badge"] == "beyond its limit"
        seen = pixels(tab, "voltage")
        assert seen["forbidden"] > 500  # the band below the limit
        assert pixels(tab, "displacement")["forbidden"] == 0  # which has none


def pixels(tab, signal):
    """How many pixels of a chart are shaded, and drawn in the colour of the signal."""
    return tab.run(f"{PIXELS}({signal!r})")


@pytest.mark.slow
def test_the_chart_shows_the_last_minute_to_a_page_that_comes_late(tab):
    with (
        SmallRig() as rig,
        watching(rig.port) as watch,
        Driver(rig.endpoint, lambda number: (0.4 * (-1) ** int(4 * PERIOD * number), 1.0)),
    ):
        time.sleep(2.0)
        tab.open(watch.address, 1280)
        until(lambda: tab.run(SHOWN).get("voltage"))
        until(lambda: pixels(tab, "voltage")["drawn"] > 500)  # a few jumps over the whole height


def test_an_old_value_never_looks_fresh(tab):
    with SmallRig() as rig, watching(rig.port) as watch:
        tab.open(watch.address, 1280)
        until(lambda: tab.run(SHOWN).get("voltage"))
        rig.measures = False
        until(lambda: re.fullmatch(r"age \d\.\d s", tab.run(SHOWN)["voltage"]["age"]))
        assert tab.run(
            "document.querySelector('[data-signal=voltage] .age').classList.contains('old')"
        )
        rig.plant, rig.measures = lambda inputs, now: {"voltage": None, "displacement": 0.0}, True
        until(lambda: tab.run(SHOWN)["voltage"]["value"] == "–")
        assert tab.run(SHOWN)["voltage"]["age"] == "no value"


def test_state_and_reason_and_events(tab):
    with SmallRig() as rig, watching(rig.port) as watch:
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "idle")
        rig.safe("no command for 0.2 s")
        until(lambda: text(tab, "state") == "safe state")
        until(lambda: "no command for 0.2 s" in text(tab, "reason"))
        assert "safe · no command for 0.2 s" in text(tab, "events")
        assert tab.run("document.getElementById('state').getAttribute('aria-live')") == "polite"
        rig.state, rig.reason = "idle", ""
        until(lambda: text(tab, "state") == "idle")
        assert text(tab, "reason") == ""


NASTY = "<script>window.hurt = 1</script><img src=x onerror='window.hurt = 2'>"


def test_what_the_rig_says_is_text(tab):
    units, limits = {NASTY: "A<b>"}, {NASTY: {"min": -1.0, "max": 1.0, "rate": None}}
    with SmallRig(
        inputs=units,
        outputs={"voltage": NASTY},
        limits=limits,
        plant=lambda i, now: {"voltage": 1.0},
    ) as rig:
        rig.state, rig.reason, rig.client = "safe", NASTY, NASTY
        with watching(rig.port) as watch:
            tab.open(watch.address, 1280)
            until(lambda: text(tab, "state") == "safe state")
            until(lambda: NASTY in tab.run(SHOWN))
            until(lambda: NASTY in text(tab, "reason"))
            until(lambda: text(tab, "client") == NASTY)
            until(lambda: NASTY in text(tab, "events"))
            time.sleep(0.3)
            assert tab.run("window.hurt") is None
            assert (
                tab.run("document.images.length + document.querySelectorAll('script').length") == 1
            )
            assert tab.complaints == []


# --- the link dies, and comes back
# ----------------------------------------------------------------------------------


def test_a_server_that_is_killed_is_missed_within_a_second_and_found_again(tab):
    port = free_port()
    with small_rig_process(port) as server, watching(port) as watch:
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "idle")
        server.kill()
        server.wait()
        took, _ = until(lambda: is_lost(tab), PROMISED + ALLOWANCE)
        assert "No contact with the rig’s server" in text(tab, "alarm")
        assert text(tab, "state") == "no contact (was idle)"
        assert tab.run("document.getElementById('alarm').getAttribute('role')") == "alert"
        assert tab.run("getComputedStyle(document.getElementById('alarm')).display") == "block"
        print(f"said after {took:.2f} s")
        with SmallRig(port):
            until(lambda: not is_lost(tab) and text(tab, "state") == "idle")
            assert "contact lost" in text(tab, "events")
        assert tab.complaints == []


def test_a_server_that_hangs_is_missed_too(tab):
    with SmallRig() as rig, watching(rig.port) as watch:
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "idle")
        rig.answers = rig.publishes = False
        until(lambda: is_lost(tab), PROMISED + ALLOWANCE)
        rig.answers = rig.publishes = True
        until(lambda: not is_lost(tab))


def test_a_server_that_answers_and_publishes_nothing(tab):
    with SmallRig() as rig, watching(rig.port) as watch:
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "idle")
        rig.publishes = False
        until(lambda: is_lost(tab), PROMISED + ALLOWANCE)
        assert "No samples arrive" in text(tab, "alarm")
        rig.publishes = True
        until(lambda: not is_lost(tab))


def lost_share(tab):
    """Part of two seconds in which the page says that contact is lost."""
    said = []
    for _ in range(20):
        said.append(is_lost(tab))
        time.sleep(0.1)
    return sum(said) / len(said)


@pytest.mark.slow
def test_slow_samples_and_lockstep_are_no_lost_link(tab):
    with SmallRig(period=1.0) as slow, watching(slow.port) as watch:
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "idle")
        assert lost_share(tab) < _STALLS
    with SmallRig(mode="lockstep") as waiting, watching(waiting.port) as watch:
        waiting.publishes = False
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "idle")
        assert lost_share(tab) < _STALLS


def test_no_server_at_all(tab):
    with watching(free_port()) as watch:
        tab.open(watch.address, 1280)
        until(lambda: is_lost(tab), PROMISED + ALLOWANCE)
        assert "No contact" in text(tab, "alarm")


@posix
@pytest.mark.parametrize("number", ["SIGKILL", "SIGSTOP"])
def test_the_page_misses_the_program_that_serves_it(tab, number):
    with SmallRig() as rig, watching(rig.port) as watch:
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "idle")
        watch.send_signal(getattr(signal, number))
        until(lambda: is_lost(tab), PROMISED + ALLOWANCE)
        assert "ppy rig watch does not answer" in text(tab, "alarm")
        if number == "SIGSTOP":
            watch.send_signal(signal.SIGCONT)
            until(lambda: not is_lost(tab))


# --- the one command
# ------------------------------------------------------------------------------------------------


def test_stop_pressed_by_mouse_stops_the_rig(tab):
    with (
        SmallRig() as rig,
        watching(rig.port) as watch,
        Driver(rig.endpoint, lambda number: (0.5, 1.0)),
    ):
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "running")
        left, top, width, height = tab.run(BOX)
        x, y = left + width / 2, top + height / 2
        for kind in ("mousePressed", "mouseReleased"):
            tab.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
        until(lambda: rig.of_type("stop"))
        until(lambda: text(tab, "pressed") == "Stopped: confirmed.")
        until(lambda: text(tab, "state") == "safe state")
        until(lambda: tab.run(SHOWN)["current"]["value"] == "0.000")
        (message,) = rig.of_type("stop")
        assert message["reason"] == "stop button of ppy rig watch"
        assert {m["type"] for m in rig.heard} == {"connect", "exchange", "status", "stop"}


def test_a_page_that_outlives_its_program_can_stop_again_with_the_next_one(tab):
    with SmallRig() as rig:
        with watching(rig.port) as watch:
            port = watch.address.rstrip("/").rsplit(":", 1)[1]
            tab.open(watch.address, 1280)
            until(lambda: text(tab, "state") == "idle")
        until(lambda: is_lost(tab))
        with watching(rig.port, "--port", port):
            until(lambda: not is_lost(tab) and text(tab, "state") == "idle")
            until(lambda: tab.run("document.readyState") == "complete" and tab.run(SHOWN))
            tab.run("document.getElementById('stop').click()")
            until(lambda: text(tab, "state") == "safe state")
            assert len(rig.of_type("stop")) == 1


def test_the_emulated_rig_behind_its_own_server(tab, tmp_path):
    """A record is being made; stop is pressed; server, page and record agree; the server is
    killed.
    """
    (tmp_path / "experiment.toml").write_text(EXPERIMENT)
    with Server(tmp_path, "emulator") as server:
        port = server.wait_ready().rsplit(":", 1)[1]
        command = [
            sys.executable,
            "-m",
            "orchestration.cli",
            "rig",
            "record",
            "--stimulus",
            "experiment.toml",
        ]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        command += ["--out", "run.csv", "--endpoint", server.endpoint]
        pipe = subprocess.PIPE
        recording = subprocess.Popen(
            command, cwd=tmp_path, env=environment, stdout=pipe, stderr=pipe, text=True
        )
        with watching(port) as watch:
            tab.open(watch.address, 1280)
            until(lambda: text(tab, "client") == "ppy rig record")
            until(lambda: tab.run(SHOWN)["force"]["value"] == "1.500")
            # 1.5 N over the spring of 6300 N/m, at once, and creep of less than a tenth of that
            until(lambda: 0.2 < float(tab.run(SHOWN)["displacement"]["value"]) < 0.3)
            assert tab.run(SHOWN)["displacement"]["unit"] == "mm"
            time.sleep(1.0)  # ten rows
            tab.run("document.getElementById('stop').click()")
            until(lambda: text(tab, "state") == "safe state")
            assert "stop button of ppy rig watch" in text(tab, "reason")
            until(lambda: tab.run(SHOWN)["force"]["value"] == "0.000")
            _, complaint = recording.communicate(timeout=60)
            server.process.kill()
            until(lambda: is_lost(tab), PROMISED + ALLOWANCE)
        assert tab.complaints == []
    assert recording.returncode == 2
    assert "safe state" in complaint.splitlines()[-1]
    assert "run.csv holds" in complaint.splitlines()[-1]
    assert len((tmp_path / "run.csv").read_text().splitlines()) > 5


@pytest.mark.parametrize("width", [1280, 400])
def test_stop_is_the_first_that_the_keyboard_reaches(tab, width):
    with SmallRig() as rig, watching(rig.port) as watch:
        tab.open(watch.address, width)
        until(lambda: text(tab, "state") == "idle")
        press(tab, "Tab", 9)
        assert tab.run("document.activeElement.id") == "stop"
        press(tab, "Enter", 13, "\r")
        until(lambda: text(tab, "state") == "safe state")
        assert len(rig.of_type("stop")) == 1


def press(tab, key, code, character=None):
    about = {"key": key, "code": key, "windowsVirtualKeyCode": code}
    tab.call(
        "Input.dispatchKeyEvent",
        type="keyDown",
        **about,
        **({"text": character} if character else {}),
    )
    tab.call("Input.dispatchKeyEvent", type="keyUp", **about)


def test_a_stop_that_nobody_confirms_says_so(tab):
    with SmallRig() as rig, watching(rig.port) as watch:
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "idle")
        rig.answers = False
        tab.run("document.getElementById('stop').click()")
        until(lambda: "Not confirmed" in text(tab, "pressed"))
        assert rig.of_type("stop")  # it got through all the same


@pytest.mark.parametrize("width", [1280, 400])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_and_can_be_read(tab, width, scheme):
    with (
        SmallRig() as rig,
        watching(rig.port) as watch,
        Driver(rig.endpoint, lambda number: (1.29, 2.0), client="x" * 80),
    ):
        tab.call(
            "Emulation.setEmulatedMedia",
            features=[{"name": "prefers-color-scheme", "value": scheme}],
        )
        tab.open(watch.address, width)
        until(lambda: tab.run(SHOWN).get("current", {}).get("value") == "1.290")
        assert tab.run("document.documentElement.scrollWidth") <= width
        _, top, wide, high = tab.run(BOX)
        assert 0 <= top < top + high <= 900
        assert wide > 150
        for place in (
            "#state",
            "#stop",
            "#client",
            ".number",
            ".badge",
            ".limits",
            ".age",
            "h2",
            "dt",
            "#events span",
        ):
            assert contrast(tab, place) >= 4.5, place  # WCAG 2 AA
    tab.call("Emulation.setEmulatedMedia", features=[])


def contrast(tab, place):
    """Contrast ratio of a text to what is behind it, by WCAG 2."""
    colours = tab.run(f"{COLOURS}({place!r})")
    bright, dark = sorted((luminance(colour) for colour in colours), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def luminance(colour):
    linear = [
        v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4
        for v in (c / 255.0 for c in colour)
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


# --- what others may not do
# -----------------------------------------------------------------------------------------


def ask(watch, method, path, headers=None, body=None):
    host, port = watch.address.removeprefix("http://").rstrip("/").split(":")
    connection = http.client.HTTPConnection(host, int(port), timeout=PATIENCE)
    try:
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        return answer.status, answer.read().decode(), answer.headers
    finally:
        connection.close()


def test_only_the_page_itself_can_stop(tmp_path):
    with SmallRig() as rig, watching(rig.port) as watch:
        status, page, headers = ask(watch, "GET", "/")
        assert status == 200
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        token = re.search(r'name="rig-token" content="([^"]{20,})"', page)[1]
        own = watch.address.rstrip("/")
        bad = [
            ("/stop", {}),
            ("/stop", {"X-Rig-Token": "x"}),
            ("/stop", {"X-Rig-Token": token[:-1]}),
            ("/stop", {"X-Rig-Token": token, "Origin": "https://evil.example"}),
            ("/stop", {"X-Rig-Token": token, "Host": "evil.example:8765"}),
            ("/acknowledge", {"X-Rig-Token": token}),
            ("/", {"X-Rig-Token": token}),
        ]
        for path, sent in bad:
            status, _, _ = ask(watch, "POST", path, sent, "")
            assert status in (403, 404), (path, sent)
        for host in ("evil.example", "127.0.0.1", "127.0.0.1:1", "", "localhost.evil.example"):
            for path in ("/", "/stream", "/page.js"):
                assert ask(watch, "GET", path, {"Host": host})[0] == 403
        for method in ("PUT", "DELETE", "OPTIONS"):
            assert ask(watch, method, "/stop", {"X-Rig-Token": token})[0] == 501
        for path in (
            "/../serve.py",
            "/page.html/../../serve.py",
            "/serve.py",
            "/page/page.js",
            "//etc/passwd",
        ):
            assert ask(watch, "GET", path)[0] == 404
        assert rig.of_type("stop") == []
        assert ask(watch, "POST", "/stop", {"X-Rig-Token": token, "Origin": own}, "")[0] == 200
        assert len(rig.of_type("stop")) == 1


def test_rubbish_and_silence_do_not_hold_it_up():
    with SmallRig() as rig, watching(rig.port) as watch:
        port = int(watch.address.rstrip("/").rsplit(":", 1)[1])
        held = [socket.create_connection(("127.0.0.1", port)) for _ in range(20)]
        for number, connection in enumerate(held):
            connection.sendall(os.urandom(100) + b"\n" if number % 2 else b"GET / HT")
        for length in ("-5", "x", str(10**12)):
            with socket.create_connection(("127.0.0.1", port)) as connection:
                connection.sendall(
                    f"POST /stop HTTP/1.0\r\nHost: 127.0.0.1:{port}\r\nContent-Length:"
                    f" {length}\r\n\r\n".encode()
                )
        assert ask(watch, "GET", "/")[0] == 200
        for connection in held:
            connection.close()
        assert ask(watch, "GET", "/")[0] == 200
        assert rig.of_type("stop") == []


def test_keys_are_used(tab, tmp_path):
    server_file, client_file = make_keys(tmp_path)
    with SmallRig(keys=server_file) as rig:
        with watching(rig.port, "--credentials", client_file) as watch:
            tab.open(watch.address, 1280)
            until(lambda: text(tab, "state") == "idle")
            tab.run("document.getElementById('stop').click()")
            until(lambda: text(tab, "state") == "safe state")
        before = len(rig.heard)
        with watching(rig.port) as watch:
            tab.open(watch.address, 1280)
            until(lambda: is_lost(tab))
            assert len(rig.heard) == before


# --- the command
# --------------------------------------------------------------------------------------------------


@posix
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_at_once_even_with_a_page_open(tab, number):
    with SmallRig() as rig, watching(rig.port) as watch:
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "idle")
        began = time.monotonic()
        watch.send_signal(number)
        assert watch.wait(PATIENCE) == 0
        assert (
            time.monotonic() - began < 3.0
        )  # at once, and what a loaded machine takes to end Python
        assert "Traceback" not in watch.stderr.read()


def test_a_port_that_is_taken(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        line = refused(tmp_path, "rig", "watch", "--no-browser", "--port", taken.getsockname()[1])
        assert "--port" in line
