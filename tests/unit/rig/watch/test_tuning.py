"""Claims: pages have the parameters of the run that answers, as text and numbers, else none."""

from __future__ import annotations

from time import monotonic, sleep

from fmus.kit import UserError
from orchestration.rig.watch.feed import Feed
from orchestration.rig.watch.tuning import parameters_fed

GAIN = {"value": 1.0, "target": 2.0, "min": None, "max": 9.0, "unit": "1", "doc": "gain"}
SHADY = {"value": "<b>", "target": 1e400, "min": None, "max": True, "unit": "\u202e", "doc": "x"}


def newest(feed):
    """The parameters that a page has which was just opened."""
    return next(item for item in feed.since(-1).items if item["kind"] == "parameters")["parameters"]


def until_it_is(feed, expected):
    began = monotonic()
    while newest(feed) != expected:
        assert monotonic() - began < 10.0
        sleep(0.02)


def test_they_follow_the_run_and_are_gone_with_it():
    run = {"K": GAIN}
    feed = Feed()

    def parameters():
        if not run:
            raise UserError("no answer")
        return run

    with parameters_fed(parameters, feed):
        until_it_is(feed, {"K": GAIN})
        serial = feed.since(-1).serial
        run["K"] = GAIN | {"value": 2.0}
        until_it_is(feed, {"K": GAIN | {"value": 2.0}})
        assert [item["kind"] for item in feed.since(serial).items if "parameters" in item] == [
            "parameters"
        ]
        run.clear()
        until_it_is(feed, {})


def test_what_is_no_number_or_turns_a_text_is_none_or_written_out():
    feed = Feed()
    feed.take_parameters({"K": SHADY})
    nothing = dict.fromkeys(("value", "target", "min", "max"))
    assert newest(feed) == {"K": {**nothing, "unit": "\\u202e", "doc": "x"}}
