"""Claims: the live view shows a rig as it is, says within a second that it cannot, and commands
nothing but stop.
"""

from __future__ import annotations

import http.client
import http.server
import os
import re
import signal
import socket
import threading
import time
from contextlib import contextmanager

import pytest

from orchestration.rig.keys import make_keys
from tests.support.browser import chromium
from tests.support.command import posix, recording, refused, running
from tests.support.rig.driver import PERIOD, Driver
from tests.support.rig.process import ROOT, Server
from tests.support.rig.small_rig import SmallRig, free_port, small_rig_process

pytestmark = pytest.mark.real_time

PROMISED = 1.0  # s until the page says that contact is lost
ALLOWANCE = 1.0  # s more, for a machine on which a browser and other tests compete for two cores
# of the time, in which a busy machine may not let the rig answer; taken for lost it would be a
# third
_STALLS = 0.2
PATIENCE = 45.0  # s, for what takes milliseconds on an idle machine
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
DURATION = r"(\d+ ms|\d+\.\d s)"  # a busy machine needs more than a second
BOX = (
    "(r => [r.left, r.top, r.width,"
    " r.height])(document.getElementById('stop').getBoundingClientRect())"
)


@contextmanager
def watching(rig_port, *more):
    """The command in a process of its own; its address."""
    endpoint = f"tcp://127.0.0.1:{rig_port}"
    page = ("rig", "watch", "--no-browser", "--port", "0")
    process = running(*page, "--endpoint", endpoint, *more, cwd=ROOT)
    try:
        found = re.search(r"at (http://127\.0\.0\.1:(\d+)/)", process.stdout.readline())
        process.address = found[1]
        process.port = int(found[2])
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


def until_it_reads(tab, place, pattern):
    """Wait until a text of the page matches; says which did not."""
    shown = ""

    def matches():
        nonlocal shown
        shown = text(tab, place)
        return re.fullmatch(pattern, shown)

    try:
        until(matches)
    except AssertionError as late:
        raise AssertionError(f"{late}: {place} reads {shown!r}, not {pattern!r}") from None


@contextmanager
def idle_page(tab, rig_port, *more, width=1280):
    """The page of a rig at rest, open in a tab; the command that serves it."""
    with watching(rig_port, *more) as watch:
        tab.open(watch.address, width)
        until(lambda: text(tab, "state") == "idle")
        yield watch


def is_safe(tab):
    return text(tab, "word") == "safe"


def is_lost(tab):
    return tab.run(
        "document.getElementById('alarm')?.hidden === false && document.body.dataset.state ==="
        " 'lost'"
    )


# --- what is shown
# --------------------------------------------------------------------------------------------------


def test_every_signal_with_unit_limits_and_age(tab):
    with SmallRig() as rig, idle_page(tab, rig.port) as watch:
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
            assert re.fullmatch(r"age at most \d+ ms", shown["voltage"]["age"])
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
    """Count the pixels of a chart that are shaded, and drawn in the colour of the signal."""
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
        until(lambda: re.fullmatch(r"age at most \d\.\d s", tab.run(SHOWN)["voltage"]["age"]))
        assert tab.run("document.querySelector('[data-signal=voltage]').classList.contains('old')")
        assert opacity(tab, "voltage") == "0.5"
        assert opacity(tab, "current") == "1"  # which is known to be applied
        rig.plant, rig.measures = lambda inputs, now: {"voltage": None, "displacement": 0.0}, True
        until(lambda: tab.run(SHOWN)["voltage"]["value"] == "–")
        assert tab.run(SHOWN)["voltage"]["age"] == "no value"


def opacity(tab, signal):
    return tab.run(
        f"getComputedStyle(document.querySelector('[data-signal={signal}] .value')).opacity"
    )


def test_after_a_safe_state_commands_are_zero_or_dimmed_with_their_age(tab):
    """A rig in lockstep says no more once it is safe: what is shown then was the last command."""
    with SmallRig(mode="lockstep") as rig, watching(rig.port) as watch:
        tab.open(watch.address, 1280)
        with Driver(rig.endpoint, lambda number: (0.5, 1.0)):
            until(lambda: tab.run(SHOWN).get("current", {}).get("value") == "0.500")
        rig.publishes = False
        rig.safe("somebody pulled the plug")
        until(lambda: is_safe(tab))
        until(
            lambda: (
                re.fullmatch(r"last command, \d\.\d s ago", tab.run(SHOWN)["current"]["age"])
                and opacity(tab, "current") == "0.5"
            )
        )
        rig.publishes = True
        until(
            lambda: tab.run(SHOWN)["current"]["value"] == "0.000" and opacity(tab, "current") == "1"
        )


def test_state_and_reason_and_events(tab):
    with SmallRig() as rig, idle_page(tab, rig.port):
        rig.safe("no command for 0.2 s")
        until(lambda: is_safe(tab))
        until(lambda: "no command for 0.2 s" in text(tab, "reason"))
        assert "safe (reached after 0 ms) · no command for 0.2 s" in text(tab, "events")
        assert tab.run("document.getElementById('state').getAttribute('aria-live')") == "polite"
        rig.acknowledge()
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
            until(lambda: is_safe(tab))
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
    with small_rig_process(port) as server, idle_page(tab, port):
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
    with SmallRig() as rig, idle_page(tab, rig.port):
        rig.answers = rig.publishes = False
        until(lambda: is_lost(tab), PROMISED + ALLOWANCE)
        rig.answers = rig.publishes = True
        until(lambda: not is_lost(tab))


def test_a_server_that_answers_and_publishes_nothing(tab):
    with SmallRig() as rig, idle_page(tab, rig.port):
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
    with SmallRig(period=1.0) as slow, idle_page(tab, slow.port):
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
        until(lambda: "No contact" in text(tab, "alarm"))
        assert "or the keys do not match" in text(tab, "alarm")


@posix
@pytest.mark.parametrize("number", ["SIGKILL", "SIGSTOP"])
def test_the_page_misses_the_program_that_serves_it(tab, number):
    with SmallRig() as rig, idle_page(tab, rig.port) as watch:
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
        idle_page(tab, rig.port),
        Driver(rig.endpoint, lambda number: (0.5, 1.0)),
    ):
        until(lambda: text(tab, "state") == "running")
        left, top, width, height = tab.run(BOX)
        x, y = left + width / 2, top + height / 2
        for kind in ("mousePressed", "mouseReleased"):
            tab.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
        until(lambda: rig.of_type("stop"))
        until_it_reads(tab, "pressed", rf"Safe: reached after {DURATION}\.")
        until(lambda: is_safe(tab))
        until(lambda: tab.run(SHOWN)["current"]["value"] == "0.000")
        (message,) = rig.of_type("stop")
        assert message["reason"] == "stop button of ppy rig watch"
        assert {m["type"] for m in rig.heard} == {"connect", "exchange", "status", "stop"}


def left_page(tab, rig_port):
    """Open the page of a rig at rest, and end the command that serves it; return its port."""
    with idle_page(tab, rig_port) as watch:
        return watch.port


def test_a_page_that_outlives_its_program_can_stop_again_with_the_next_one(tab):
    with SmallRig() as rig:
        port = left_page(tab, rig.port)
        until(lambda: is_lost(tab))
        with watching(rig.port, "--port", port):
            until(lambda: not is_lost(tab) and text(tab, "state") == "idle")
            until(lambda: tab.run("document.readyState") == "complete" and tab.run(SHOWN))
            tab.run("document.getElementById('stop').click()")
            until(lambda: is_safe(tab))
            assert len(rig.of_type("stop")) == 1


def test_a_page_of_an_earlier_program_whose_stop_was_pressed_says_what_it_is(tab):
    with SmallRig() as rig:
        port = left_page(tab, rig.port)
        press_stop(tab)
        until(lambda: text(tab, "pressed").startswith("NOT CONFIRMED"))
        with watching(rig.port, "--port", port):
            until(lambda: "of an earlier ppy rig watch" in (text(tab, "alarm") or ""))
            assert "reload it" in text(tab, "alarm")
            press_stop(tab)  # with a token that the new program does not know
            time.sleep(0.5)
            assert text(tab, "pressed").startswith("NOT CONFIRMED")
            assert "of an earlier ppy rig watch" in text(tab, "alarm")
            assert rig.of_type("stop") == []
            tab.call("Page.reload")
            until(lambda: text(tab, "state") == "idle")
            press_stop(tab)
            until(lambda: is_safe(tab))


def test_the_emulated_rig_behind_its_own_server(tab, tmp_path):
    """A record is being made; stop is pressed; server, page and record agree; the server is
    killed.
    """
    (tmp_path / "experiment.toml").write_text(EXPERIMENT)
    with Server(tmp_path, "emulator") as server:
        port = server.wait_ready().rsplit(":", 1)[1]
        arguments = recording(server.endpoint, "experiment.toml", out="run.csv")
        with running(*arguments, cwd=tmp_path) as driving, watching(port) as watch:
            tab.open(watch.address, 1280)
            until(lambda: text(tab, "client").startswith("ppy rig record ("))
            until(lambda: tab.run(SHOWN)["force"]["value"] == "1.500")
            # 1.5 N over the spring of 6300 N/m, at once, and creep of less than a tenth of that
            until(lambda: 0.2 < float(tab.run(SHOWN)["displacement"]["value"]) < 0.3)
            assert tab.run(SHOWN)["displacement"]["unit"] == "mm"
            time.sleep(1.0)  # ten rows
            press_stop(tab)
            until_it_reads(tab, "state", rf"safe \(reached after {DURATION}\)")
            until_it_reads(tab, "pressed", rf"Safe: reached after {DURATION}\.")
            assert "stop button of ppy rig watch" in text(tab, "reason")
            until(lambda: tab.run(SHOWN)["force"]["value"] == "0.000")
            _, complaint = driving.communicate(timeout=60)
            server.process.kill()
            until(lambda: is_lost(tab), PROMISED + ALLOWANCE)
        assert tab.complaints == []
    assert driving.returncode == 1, complaint
    assert "safe state" in complaint.splitlines()[-1]
    assert "run.csv holds" in complaint.splitlines()[-1]
    assert len((tmp_path / "run.csv").read_text().splitlines()) > 5


@pytest.mark.parametrize("width", [1280, 400])
def test_stop_is_the_first_that_the_keyboard_reaches(tab, width):
    with SmallRig() as rig, idle_page(tab, rig.port, width=width):
        press(tab, "Tab", 9)
        assert tab.run("document.activeElement.id") == "stop"
        press(tab, "Enter", 13, "\r")
        until(lambda: is_safe(tab))
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


def test_a_stop_that_nobody_confirms_says_so_and_one_whose_answer_is_lost_does_not(tab):
    with SmallRig() as rig, idle_page(tab, rig.port):
        rig.answers = rig.publishes = False
        press_stop(tab)
        until(lambda: text(tab, "pressed").startswith("NOT CONFIRMED"))
        assert "emergency stop at the rig" in text(tab, "pressed")
        assert rig.of_type("stop")  # it got through all the same
        rig.publishes = True  # and so telemetry says
        until(lambda: text(tab, "pressed").startswith("Safe"))


def press_stop(tab):
    tab.run("document.getElementById('stop').click()")


# every text of the state and of the button, in order
KEEP = """(() => { window.kept = [];
  const keep = () => { const now = ["state", "pressed"].map(
      id => document.getElementById(id).textContent);
    if (JSON.stringify(window.kept.at(-1)) !== JSON.stringify(now)) window.kept.push(now) };
  keep();
  new MutationObserver(keep).observe(
    document.body, { subtree: true, childList: true, characterData: true }) })()"""


def test_safe_is_said_when_the_rig_is_and_not_before(tab):
    """The safe state takes 600 ms, and the rig says so; no word of the page is earlier."""
    with (
        SmallRig() as rig,
        idle_page(tab, rig.port),
        Driver(rig.endpoint, lambda number: (0.5, 1.0)),
    ):
        rig.settling, rig.bound = 0.6, 5.0
        until(lambda: text(tab, "state") == "running")
        tab.run(KEEP)
        press_stop(tab)
        until(lambda: text(tab, "state") == "stopping…")
        assert text(tab, "pressed") == "Stopping…"
        until(lambda: text(tab, "pressed").startswith("Safe"))
        kept = tab.run("window.kept")
        reached = f"reached after {1000 * rig.reached:.0f} ms"
        assert kept[-1] == [f"safe ({reached})", f"Safe: {reached}."]
        words = list(dict.fromkeys(word for word, _ in kept))
        assert words == ["running", "stopping…", f"safe ({reached})"]
        told = list(dict.fromkeys(pressed for _, pressed in kept))
        assert told == ["", "Stopping…", f"Safe: {reached}."]
        assert not any("onfirmed" in pressed for pressed in told)
        assert tab.run("document.title") == "safe – rig"
        rig.acknowledge()
        until(lambda: text(tab, "state") == "idle" and text(tab, "pressed") == "")


def test_a_safe_state_that_is_not_reached_is_an_alarm_until_it_is_acknowledged(tab):
    with SmallRig() as rig, watching(rig.port) as watch:
        rig.settling = 1e9
        tab.open(watch.address, 1280)
        until(lambda: text(tab, "state") == "idle")
        assert tab.run("document.getElementById('alarm').hidden")
        press_stop(tab)
        until(lambda: text(tab, "state") == "NOT REACHED")
        assert text(tab, "pressed") == "NOT REACHED: use the emergency stop at the rig."
        assert "not safe within 0.2 s" in text(tab, "alarm")
        assert tab.run("document.title").startswith("ALARM: NOT REACHED")
        assert tab.run("document.getElementById('alarm').getAttribute('role')") == "alert"
        red, green, blue = tab.run(f"{COLOURS}('#word')")[1]
        assert red > 150 > 100 > max(green, blue)
        rig.settling = 0.0  # late: safe now, but somebody has to know
        until(lambda: is_safe(tab))
        assert tab.run("document.title").startswith("ALARM")
        assert "not safe within 0.2 s" in text(tab, "alarm")
        rig.acknowledge()
        until(lambda: tab.run("document.getElementById('alarm').hidden"))
        assert tab.run("document.title") == "idle – rig"
        assert text(tab, "pressed") == ""


def test_an_alarm_is_shown_in_every_state_and_beside_a_lost_contact(tab):
    with SmallRig() as rig, idle_page(tab, rig.port):
        rig.alarm = "voltage has not moved for 200 samples"
        until(lambda: rig.alarm in text(tab, "alarm"))
        assert text(tab, "state") == "idle"
        assert tab.run("document.title") == "ALARM: idle – rig"
        rig.publishes = rig.answers = False
        until(lambda: is_lost(tab))
        assert rig.alarm in text(tab, "alarm")
        assert "No contact" in text(tab, "alarm")
        assert tab.run("document.title") == "ALARM: no contact – rig"


# --- many tabs
# --------------------------------------------------------------------------------------------------

TABS = 20
PRESSED = 1.0  # s in which a stop has reached the server, whatever else is open
FRESH = """(() => { const age = document.querySelector("[data-signal=voltage] .age");
  return document.body.dataset.state === "running" && !age.classList.contains("old")
    && /^age at most \\d+ ms$/.test(age.textContent) })()"""


@contextmanager
def many_tabs(tab, address, count=TABS, before=""):
    """More tabs of the same browser, with a script that runs before the page's own."""
    tabs = [tab.another() for _ in range(count)]
    try:
        for each in tabs:
            if before:
                each.call("Page.addScriptToEvaluateOnNewDocument", source=before)
            each.open(address, 1280)
        yield tabs
    finally:
        for each in tabs:
            each.close()


def time_to_the_server(rig, tab):
    """Press stop, and return how long the rig's server waited for it, in s."""
    before = len(rig.of_type("stop"))
    began = time.monotonic()
    tab.call("Runtime.evaluate", expression="document.getElementById('stop').click()")
    until(lambda: len(rig.of_type("stop")) > before)
    return time.monotonic() - began


@pytest.mark.parametrize("before", ["", "delete window.SharedWorker"])
def test_with_twenty_tabs_all_are_fresh_and_stop_gets_through(tab, before, tmp_path, browser):
    """Of one browser, which has six connections; and of a second one with a profile of its own,
    which shares nothing with it.
    """
    with (
        SmallRig() as rig,
        watching(rig.port) as watch,
        Driver(rig.endpoint, lambda number: (0.5, 1.0), timeout=1.0),
        many_tabs(tab, watch.address, before=before) as tabs,
        chromium(browser, tmp_path / "another profile") as stranger,
    ):
        stranger.open(watch.address, 1280)
        for each in (*tabs, stranger):
            until(lambda each=each: each.run(FRESH))
        ask_themselves = [any("/stream?" in url for url in each.requests) for each in tabs]
        assert ask_themselves == [bool(before)] * TABS  # or the worker does it for all
        took = time_to_the_server(rig, tabs[-1])
        print(f"stop reached the server after {1000 * took:.0f} ms")
        assert took < PRESSED
        for each in (*tabs, stranger):
            until(lambda each=each: is_safe(each))
        until(lambda: text(tabs[-1], "pressed").startswith("Safe"))
        rig.acknowledge()
        for each in (*tabs, stranger):
            until(lambda each=each: text(each, "state") == "idle")
        assert time_to_the_server(rig, stranger) < PRESSED
        assert [each.complaints for each in (*tabs, stranger)] == [[]] * (TABS + 1)


def test_a_worker_that_does_not_answer_is_done_without(tab):
    silent = "window.SharedWorker = class { port = new MessageChannel().port1 }"
    with (
        SmallRig() as rig,
        watching(rig.port) as watch,
        many_tabs(tab, watch.address, 1, silent) as (alone,),
    ):
        until(lambda: text(alone, "state") == "idle")
        press_stop(alone)
        until(lambda: is_safe(alone))


def test_a_stop_is_sent_although_the_tab_is_closed_at_once(tab):
    with SmallRig() as rig, watching(rig.port) as watch:
        leaving = tab.another()
        leaving.open(watch.address, 1280)
        until(lambda: text(leaving, "state") == "idle")
        leaving.run("document.getElementById('stop').click(); location = 'about:blank'")
        leaving.close()
        until(lambda: rig.of_type("stop"), PRESSED)


@pytest.mark.parametrize("state", ["hidden", "frozen"])
def test_a_tab_that_was_away_is_fresh_again_and_can_stop(tab, state):
    with SmallRig() as rig, watching(rig.port) as watch:
        away = tab.another()
        away.open(watch.address, 1280)
        until(lambda: text(away, "state") == "idle")
        if state == "frozen":
            away.call("Page.setWebLifecycleState", state="frozen")
        else:
            tab.call("Page.bringToFront")
        rig.safe("no command for 0.2 s")
        time.sleep(1.5)
        if state == "frozen":
            away.call("Page.setWebLifecycleState", state="active")
        else:
            assert away.run("document.visibilityState") == "hidden"
            assert away.run("document.title") == "safe – rig"  # all that is seen of it
            away.call("Page.bringToFront")
        until(lambda: is_safe(away) and not is_lost(away))
        press_stop(away)
        until(lambda: rig.of_type("stop"), PRESSED)
        away.close()


# --- ages
# --------------------------------------------------------------------------------------------------

AGE = """(() => { const text = document.querySelector("[data-signal=voltage] .age").textContent;
  const found = /^age at most ([\\d.]+) (ms|s)$/.exec(text);
  return found ? found[1] * (found[2] === "ms" ? 0.001 : 1) : null })()"""


def test_an_age_has_the_way_of_the_sample_in_it_and_grows_when_contact_is_lost(tab):
    """Samples are under way for 400 ms, and the rig's clock is not ours."""
    with SmallRig() as rig, watching(rig.port) as watch:
        rig.clock_ahead, rig.transit = -12345.6, 0.4
        tab.open(watch.address, 1280)
        until(lambda: tab.run(SHOWN).get("voltage") and tab.run(AGE))
        time.sleep(1.0)
        ages = [tab.run(AGE) for _ in range(20)]
        assert min(ages) >= 0.4
        assert sorted(ages)[10] < 0.4 + 0.35  # and a poll, a drawing, and a busy machine
        rig.publishes = rig.answers = False
        until(lambda: is_lost(tab))
        before, began = tab.run(AGE), time.monotonic()
        time.sleep(1.5)
        assert tab.run(AGE) - before == pytest.approx(time.monotonic() - began, abs=0.2)
        assert tab.run(SHOWN)["current"]["age"].startswith("last command, ")
        watch.kill()
        before, began = tab.run(AGE), time.monotonic()
        time.sleep(1.5)
        assert tab.run(AGE) - before == pytest.approx(time.monotonic() - began, abs=0.2)


def test_an_age_that_nobody_knows_is_not_made_up(tab):
    with SmallRig() as rig, watching(rig.port) as watch:
        tab.open(watch.address, 1280)
        until(lambda: tab.run(SHOWN).get("voltage") and tab.run(AGE) is not None)
        rig.answers = False  # no round trip with the new clock
        rig.clock_ahead = 1e6
        until(lambda: tab.run(SHOWN)["voltage"]["age"] == "age –")
        rig.answers = True
        until(lambda: tab.run(AGE) is not None)


def test_an_input_that_nobody_knows_and_one_that_the_device_has_otherwise(tab):
    with (
        SmallRig() as rig,
        watching(rig.port) as watch,
        Driver(rig.endpoint, lambda number: (0.5, 1.0)),
    ):
        rig.read_back = {"current": 0.51, "force": 1.0}
        tab.open(watch.address, 1280)
        until(lambda: tab.run(SHOWN).get("current", {}).get("value") == "0.500")
        assert read_back(tab, "current") == ""  # within 2 % of the range
        rig.read_back = {"current": -0.2, "force": 1.0}
        until(lambda: read_back(tab, "current") == "the device has −0.200 A")
        assert read_back(tab, "force") == ""
        rig.unknown = {"current"}
        until(lambda: tab.run(SHOWN)["current"]["value"] == "unknown")
        assert tab.run(SHOWN)["current"]["unit"] == ""
        assert read_back(tab, "current") == "the device has −0.200 A"
        assert tab.run(SHOWN)["force"]["value"] == "1.000"


def read_back(tab, signal):
    return tab.run(f"document.querySelector('[data-signal={signal}] .read-back').textContent")


def test_what_is_invisible_or_turns_the_text_around_is_written_out(tab):
    turned = "gnp.\u202eexe\u200b\u2066"
    units = {turned: "A"}
    with SmallRig(inputs=units, limits={}, plant=lambda i, now: {}) as rig:
        rig.state, rig.reason, rig.client, rig.alarm = "safe", turned, turned, turned
        with watching(rig.port) as watch:
            tab.open(watch.address, 1280)
            shown = r"gnp.\u202eexe\u200b\u2066"
            until(lambda: text(tab, "reason") == text(tab, "client") == shown)
            until(lambda: shown in tab.run(SHOWN))
            assert shown in text(tab, "alarm")
            assert shown in text(tab, "events")
            rig.state = f"odd {turned}"
            until(lambda: shown in tab.run("document.title"))
            everything = tab.run("document.title + document.documentElement.outerHTML")
            assert not [c for c in everything if c in turned and not c.isprintable()]


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
            "#word",
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
    connection = http.client.HTTPConnection("127.0.0.1", watch.port, timeout=PATIENCE)
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
            for path in ("/", "/stream?after=-1", "/page.js"):
                assert ask(watch, "GET", path, {"Host": host})[0] == 403
        for site in ("cross-site", "same-site"):
            for path in ("/", "/stream?after=-1", "/page.js"):
                assert ask(watch, "GET", path, {"Sec-Fetch-Site": site})[0] == 403
            bad = {"X-Rig-Token": token, "Sec-Fetch-Site": site}
            assert ask(watch, "POST", "/stop", bad, "")[0] == 403
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


EMBEDDING = """<!DOCTYPE html><title>evil</title>
<script src="{address}page.js" type="module"></script>
<link rel="stylesheet" href="{address}page.css">
<img src="{address}stream?after=-1"><iframe src="{address}"></iframe>
<form method="post" action="{address}stop" target="frame"></form><iframe name="frame"></iframe>
<script>
document.forms[0].submit();
const ask = (path, more) => fetch("{address}" + path, {{ mode: "no-cors", ...more }});
const asked = [ask("stream?after=-1"), ask(""), ask("stop", {{ method: "POST" }})];
Promise.allSettled(asked).then(() => {{ document.title = "done" }});
</script>"""


@contextmanager
def foreign_site(address):
    """A site at another port of this machine, whose page asks for everything of ours."""
    content = EMBEDDING.format(address=address).encode()

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *arguments):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()
            thread.join()


def answers(tab, watch):
    return [(url, status) for url, status in tab.statuses() if url.startswith(watch.address)]


@pytest.mark.parametrize("kind", ["same-site", "cross-site"])
def test_a_page_of_another_site_gets_nothing(tab, kind, tmp_path):
    """Another port of this machine is the same site to a browser; a file is of no site at all."""
    with SmallRig() as rig, watching(rig.port) as watch, foreign_site(watch.address) as site:
        if kind == "cross-site":
            (tmp_path / "evil.html").write_text(EMBEDDING.format(address=watch.address))
            site = tmp_path / "evil.html"
        tab.open(site, 1280)
        until(lambda: tab.run("document.title") == "done")
        until(lambda: tab.run("true") and len(answers(tab, watch)) == 8)
        assert {status for _, status in answers(tab, watch)} == {403}
        assert {url.removeprefix(watch.address) for url, _ in answers(tab, watch)} == {
            "",
            "page.js",
            "page.css",
            "stream?after=-1",
            "stop",
        }
        assert rig.of_type("stop") == []
        tab.open(watch.address, 1280)  # whoever types the address is served
        until(lambda: text(tab, "state") == "idle")


def test_rubbish_and_silence_do_not_hold_it_up():
    with SmallRig() as rig, watching(rig.port) as watch:
        port = watch.port
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
        with idle_page(tab, rig.port, "--credentials", client_file):
            tab.run("document.getElementById('stop').click()")
            until(lambda: is_safe(tab))
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
    with SmallRig() as rig, idle_page(tab, rig.port) as watch:
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
