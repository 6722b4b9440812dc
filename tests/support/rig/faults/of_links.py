"""The cable between client and server fails."""

from __future__ import annotations

import time

from tests.support.rig.bad_link import Treatment, clean, damaging, delaying, doubling, dropping
from tests.support.rig.driver import Driver
from tests.support.rig.faults.bench import Bench, fault


def _during(
    bench: Bench,
    treatment: Treatment,
    seconds: float,
    timeout: float = 0.04,
    least: float = 0.0,
) -> Driver:
    """Exchange over a bad cable for a while, then cut it: the safe state must come in time all the
    same. A share of the exchanges, at least, must be answered before.
    """
    bench.serve()
    driver = bench.connect(reconnect=True, timeout=timeout)
    bench.link.treatment = treatment
    until = time.monotonic() + seconds
    while time.monotonic() < until and bench.status()["state"] == "running":
        time.sleep(0.05)
    answered = len(driver.samples)
    assert answered > least * (answered + driver.unanswered)
    bench.link.treatment = dropping(1.0)
    safe = bench.safe_after(bench.link.fresh[0])
    bench.measure_from_fresh(safe)
    assert driver.longest < timeout + 0.06 + bench.allowance, (
        f"an exchange took {driver.longest:.3f} s; its timeout is {timeout:g} s"
    )
    ages = [sample["ages"][0] for sample in driver.samples]
    assert max(ages) < 0.1 + bench.allowance
    return driver


def _told(bench: Bench, driver: Driver) -> str:
    counts = ", ".join(
        f"{number} {what}" for what, number in bench.status()["counts"].items() if number
    )
    return (
        f"{len(driver.samples)} answers, {driver.unanswered} without; server:"
        f" {counts or 'nothing to count'}"
    )


def _dropped(share: float, least: int) -> str:
    return (
        f"at least {least} % of the exchanges are answered, none is waited for too long; safe when"
        " the cable is cut"
    )


@fault("1 % of the messages dropped", _dropped(0.01, 90))
def drop_1(bench: Bench) -> None:
    _drop(bench, 0.01, 0.9)


@fault("10 % of the messages dropped", _dropped(0.1, 60), quick=True)
def drop_10(bench: Bench) -> None:
    _drop(bench, 0.1, 0.6)


def _drop(bench: Bench, share: float, least: float) -> None:
    driver = _during(bench, dropping(share), 2.0, least=least)
    bench.observed = _told(bench, driver)


@fault(
    "50 % of the messages dropped",
    "the watchdog decides; safe when too many in a row are lost, or the cable is cut",
)
def drop_50(bench: Bench) -> None:
    driver = _during(bench, dropping(0.5), 3.0)
    bench.server.wait_line("SAFE STATE: no fresh command")
    bench.is_latched("no fresh command")
    bench.observed = _told(bench, driver)


@fault(
    "messages delayed by 5 to 40 ms",
    "served on; late answers are no new ones; safe when the cable is cut",
)
def delay(bench: Bench) -> None:
    driver = _during(bench, delaying(0.005, 0.04), 3.0, timeout=0.1)
    assert len(driver.samples) > 20
    bench.observed = _told(bench, driver)


@fault(
    "messages delayed by more than the watchdog time",
    "no command is carried out late: refused as stale; safe",
)
def delay_long(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    bench.link.treatment = delaying(2.0 * bench.watchdog, 2.5 * bench.watchdog)
    changed = time.monotonic()
    safe = bench.safe_after(changed)
    bench.measure_from_fresh(safe)
    time.sleep(5.0 * bench.watchdog)
    bench.is_latched("no fresh command")
    assert all(call.time < safe.time for call in server.calls() if call.what.startswith("write"))
    bench.observed = "safe; nothing was written afterwards"


@fault(
    "every message doubled",
    "the second one is dropped and counted; safe when the cable is cut",
    quick=True,
)
def double(bench: Bench) -> None:
    driver = _during(bench, doubling, 2.0)
    counts = bench.status()["counts"]
    assert counts["repeated"] + counts["late"] > 0.5 * len(driver.samples)
    sequences = [(sample["session"], sample["sequence"]) for sample in driver.samples]
    assert len(set(sequences)) == len(sequences)
    bench.observed = _told(bench, driver)


@fault(
    "messages overtake each other",
    "an overtaken one is dropped and counted; safe when the cable is cut",
)
def reorder(bench: Bench) -> None:
    driver = _during(bench, delaying(0.0, 0.06), 3.0)
    sequences = [sample["sequence"] for sample in driver.samples]
    assert sequences == sorted(sequences)
    assert bench.status()["counts"]["late"] > 0
    bench.observed = _told(bench, driver)


@fault(
    "1 in 5 messages damaged",
    "dropped and counted, or harmless: nothing beyond the limits; safe when cut",
    quick=True,
)
def damage(bench: Bench) -> None:
    driver = _during(bench, damaging(0.2), 2.0)
    assert bench.status()["counts"]["malformed"] > 0
    bench.observed = _told(bench, driver)


@fault(
    "the cable is cut, and whole again",
    "safe by the watchdog, latched; served again after the acknowledgement",
    quick=True,
)
def cut(bench: Bench) -> None:
    bench.serve()
    driver = bench.connect(reconnect=True)
    bench.link.treatment = dropping(1.0)
    bench.measure_from_fresh(bench.safe_after(bench.link.fresh[0]))
    bench.server.wait_line("SAFE STATE: ")
    bench.is_latched("no fresh command")
    driver.stop(orderly=False)
    bench.link.treatment = clean
    bench.recovers()
    bench.observed = "safe and latched; served again after the acknowledgement"
