"""A ring gives the last whole records in order; what was written over shows in the numbers."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestration.rig.server.ring import LENGTH, Ring
from orchestration.rig.server.shared_memory import Alarm, read_text, write_text

LAYOUT = "<d100s500s"  # of an alarm


def ring(memory=None):
    memory = bytearray(Ring.size(LAYOUT)) if memory is None else memory
    return Ring(memoryview(memory), 0, Alarm, LAYOUT), memory


def written(count, first=1):
    place, memory = ring()
    for k in range(first, first + count):
        place.write(Alarm(float(k), b"", write_text(f"record {k}")))
    return place, memory


def test_there_is_nothing_before_the_first_record():
    place, _ = ring()
    assert place.after(0) == []


def test_records_are_read_in_order_with_their_numbers_and_each_once():
    _, memory = written(10)
    reader, _ = ring(memory)
    entries = reader.after(3)
    assert [entry.number for entry in entries] == [4, 5, 6, 7, 8, 9, 10]
    assert [entry.record.time for entry in entries] == [4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0]
    times = [entry.time for entry in entries]
    assert times == sorted(times)
    assert reader.after(10) == []


@pytest.mark.parametrize("more", [0, 1, 1000, 2 * LENGTH + 7])
def test_a_reader_that_is_a_round_behind_goes_on_with_what_is_left(more):
    place, _ = written(LENGTH + more)
    numbers = [entry.number for entry in place.after(0)]
    assert numbers == list(range(numbers[0], LENGTH + more + 1))
    # the oldest ones, which are written over next, may be left out: a sixteenth of the ring
    assert len(numbers) >= LENGTH - LENGTH // 16
    assert (numbers[0] == 1) == (more == 0)


def test_another_writer_goes_on_with_the_numbers():
    _, memory = written(5)
    other, _ = ring(memory)
    other.write(Alarm(77.0, b"", b""))
    assert [(e.number, e.record.time) for e in other.after(4)] == [(5, 5.0), (6, 77.0)]


@settings(max_examples=12)
@given(st.data())
def test_a_torn_record_is_not_read_and_the_next_writer_replaces_it(data):
    place, memory = written(3)
    part = range(Ring.size(LAYOUT) // LENGTH * 4, Ring.size(LAYOUT) // LENGTH * 5)
    before = bytes(memory)
    place.write(Alarm(4.0, b"", 500 * b"4"))  # so that each byte that is torn would show
    for k in data.draw(st.lists(st.sampled_from(part), min_size=1, unique=True)):
        memory[k] = before[k]
    reader, _ = ring(memory)
    read = reader.after(0)
    assert [entry.record.time for entry in read] in ([1.0, 2.0, 3.0], [1.0, 2.0, 3.0, 4.0])
    assert all(
        read_text(entry.record.reason) in (f"record {entry.number}", "4" * 500) for entry in read
    )
    if len(reader.after(0)) == 3:
        reader.write(Alarm(5.0, b"", b""))
        assert [entry.number for entry in reader.after(2)] == [3, 4]
