"""Calls of a backend: whatever it raises is one line, and its description is checked."""

from __future__ import annotations

from math import inf, nan

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.backends.backend import Backend, Limit
from orchestration.rig.server.calls import BackendError, BackendSignals, call, measure


class Described(Backend):
    """A backend with any description and any reading."""

    def __init__(
        self,
        inputs=None,
        outputs=None,
        limits=None,
        values=None,
        safe_values=None,
        attributes=None,
    ):
        self.safe_values = safe_values or {}
        self.inputs = {"current": "A"} if inputs is None else inputs
        self.outputs = {"voltage": "V", "force": "N"} if outputs is None else outputs
        self.limits = {} if limits is None else limits
        self.values = values
        self.attributes = {} if attributes is None else attributes

    def read(self):
        return self.values

    def write(self, values):
        raise AssertionError

    def safe(self):
        raise AssertionError

    def close(self):
        raise AssertionError


def fails(error):
    def function():
        raise error

    return function


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (UserError("no\n such device"), "no such device"),
        (ValueError("of\nno use"), "read() raised ValueError: of no use"),
        (SystemExit(3), "read() raised SystemExit: 3"),
        (OSError("x" * 1000), "read() raised OSError: " + "x" * 200 + "..."),
    ],
)
def test_whatever_a_call_raises_is_one_line(error, line):
    with pytest.raises(BackendError) as caught:
        call("read()", fails(error))
    assert str(caught.value) == line


def test_an_interrupt_is_no_failure_of_the_backend():
    with pytest.raises(KeyboardInterrupt):
        call("read()", fails(KeyboardInterrupt()))


def test_a_description_is_the_same_on_the_other_side_of_the_memory():
    limits = {"current": Limit(-1.3, 1.3, rate=2.0), "voltage": Limit()}
    attributes = {"voltage": {"standard_uncertainty": 0.002, "calibration_date": "2026-05-01"}}
    signals = BackendSignals.from_backend(Described(limits=limits, attributes=attributes))
    signals.notes.append("no priority")
    again = BackendSignals.from_record(signals.to_record())
    assert again == signals
    assert again.limits == limits
    assert again.attributes == attributes
    assert again.limits["voltage"].max == inf


@pytest.mark.parametrize(
    ("given", "part"),
    [
        ({"inputs": None, "outputs": {"voltage": 3}}, "outputs of the backend must be names and"),
        ({"inputs": {f"x{k}": "1" for k in range(33)}}, "the backend has 33 inputs; 32 can be"),
        ({"outputs": {"current": "A"}}, "both commands and measures current"),
        ({"limits": {"tension": Limit()}}, "limits of 'tension', which it neither"),
        ({"limits": {"current": Limit(1.0, -1.0)}}, "limits of current are no limits: 1.0 to -1.0"),
        ({"limits": {"current": Limit(nan, 1.0)}}, "are no limits"),
        ({"limits": {"current": Limit(None, 1.0)}}, "are no limits"),
        ({"limits": {"current": Limit(rate=-1.0)}}, "are no limits"),
        ({"limits": {"current": Limit(1.0, 2.0, warn_min=2.0, warn_max=1.0)}}, "are no limits"),
        (
            {"limits": {"current": Limit(1.0, 2.0)}},
            "safe values of the backend: current 0 A is below",
        ),
        ({"safe_values": {"curent": 1.0}}, "safe values of the backend: 'curent' is not commanded"),
        ({"safe_values": {"current": nan}}, "current nan A is no finite number"),
        ({"attributes": {"voltage": {"gain": nan}}}, "attributes of signals must be finite"),
        ({"attributes": {"voltage": {"gain": None}}}, "attributes of signals must be finite"),
        ({"inputs": 5}, "the backend's description raised TypeError"),
    ],
)
def test_a_description_that_cannot_be_served_is_refused(given, part):
    with pytest.raises(BackendError, match=part.replace("(", r"\(")):
        BackendSignals.from_backend(Described(**given))


@pytest.mark.parametrize("limit", [None, Limit(), Limit(min=0.0), Limit(rate=1.0)])
def test_an_input_of_a_real_device_has_limits(limit):
    signals = BackendSignals({"current": "A"}, {}, {} if limit is None else {"current": limit})
    with pytest.raises(BackendError, match="current is commanded and has no limits"):
        signals.check_real()
    BackendSignals({"current": "A"}, {"x": "m"}, {"current": Limit(-1.0, 1.0)}).check_real()


def test_a_description_that_does_not_fit_the_memory_is_refused():
    signals = BackendSignals({"x" * 33000: "A"}, {}, {})
    with pytest.raises(BackendError, match="longer than 32768 bytes"):
        signals.to_record()


def test_a_reading_has_a_number_for_every_output_in_their_order():
    backend = Described(values={"force": 1, "voltage": 0.5, "more": "x"})
    signals = BackendSignals.from_backend(backend)
    assert list(measure(backend, signals).items()) == [("voltage", 0.5), ("force", 1.0)]
    for values in ({"voltage": 1.0}, {"voltage": 1.0, "force": "far"}, None):
        backend.values = values
        with pytest.raises(BackendError, match=r"read\(\) did not return numbers"):
            measure(backend, signals)
