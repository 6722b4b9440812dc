"""Shared memory: a slot gives the newest whole record, whenever its writer was killed."""

from __future__ import annotations

import multiprocessing
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.rig.server.shared_memory import (
    Command,
    Description,
    Sample,
    SharedMemory,
    Slot,
    Trip,
    new_memory,
    pack,
    read_text,
    unpack,
    write_text,
)

pytestmark = pytest.mark.real_time

numbers = st.lists(st.floats(allow_nan=False), max_size=32)


def slot(kind=Command):
    memory = bytearray(Slot.size(kind))
    return Slot(memoryview(memory), 0, kind), memory


def test_there_is_nothing_before_the_first_record():
    assert slot()[0].read() is None
    assert SharedMemory(new_memory()).sample.read() is None


@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.integers(0, 2**63), st.floats(allow_nan=False), numbers),
        min_size=1,
    )
)
def test_what_was_written_last_is_read(records):
    place, memory = slot()
    other_end = Slot(memoryview(memory), 0, Command)
    for order, count, accepted, values in records:
        place.write(Command(order, count, accepted, pack(values)))
    read = other_end.read()
    assert read[:3] == (order, count, accepted)
    assert unpack(read.values, len(values)) == tuple(values)


@given(st.data())
def test_a_torn_record_gives_way_to_the_one_before(data):
    """As when a writer is killed: some bytes of the newest copy are the old ones, or anything."""
    place, memory = slot()
    place.write(Command(0, 1, 1.0, b""))
    place.write(Command(1, 2, 2.0, pack([1.0, 2.0])))
    before = bytes(memory)
    place.write(Command(2, 3, 3.0, pack([3.0, 4.0])))
    changed = [k for k in range(len(memory)) if memory[k] != before[k]]
    torn = data.draw(st.lists(st.sampled_from(changed), min_size=1, unique=True))
    for k in torn:
        memory[k] = before[k]
    read = place.read()
    assert read is not None
    assert (read.order, read.acknowledged, read.accepted) in ((1, 2, 2.0), (2, 3, 3.0))
    assert unpack(read.values, 2) == ((1.0, 2.0) if read.order == 1 else (3.0, 4.0))


def test_a_writer_that_takes_another_ones_place_is_newer():
    place, memory = slot()
    for k in range(5):
        place.write(Command(acknowledged=k))
    Slot(memoryview(memory), 0, Command).write(Command(acknowledged=77))
    assert place.read().acknowledged == 77


@pytest.mark.parametrize("kind", [Command, Sample, Trip, Description])
def test_slots_of_a_board_do_not_overlap(kind):
    shared = SharedMemory(new_memory())
    shared.trip.write(Trip(1.0, True, False, write_text("one")))
    shared.rescue.write(Trip(2.0, False, True, write_text("two")))
    shared.sample.write(Sample(3, 4.0, 5, *4 * [pack(range(32))]))
    shared.command.write(Command(2, 6, 7.0, pack(range(32))))
    assert read_text(shared.trip.read().reason) == "one"
    assert read_text(shared.rescue.read().reason) == "two"
    assert unpack(shared.sample.read().taken, 32) == tuple(range(32))
    assert shared.command.read()[:3] == (2, 6, 7.0)


@given(st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=2000))
def test_a_text_is_one_line_and_cut_to_what_there_is_room_for(text):
    shared = SharedMemory(new_memory())
    shared.trip.write(Trip(0.0, True, True, write_text(text)))
    line = " ".join(text.split())
    read = read_text(shared.trip.read().reason)
    assert line.startswith(read)
    assert len(read.encode()) >= min(len(line.encode()), 497)


class Overtaken:
    """The second copy of a slot, before whose reading the writer renews both and begins a third."""

    def __init__(self, slot, *records):
        self.slot, self.records, self.half = slot, records, slot._halves[1]

    def __bytes__(self):
        if self.records:
            for record in self.records:
                self.slot.write(record)
            self.half[-1] ^= 1  # the last byte of the last one is still to come
            self.records = ()
        return bytes(self.half)


def test_a_reader_that_is_overtaken_does_not_go_back():
    memory = new_memory()
    writer, reader = SharedMemory(memory).command, SharedMemory(memory).command
    for k in (1, 2, 3):
        writer.write(Command(1, k, float(k), pack([k])))
    assert reader.read().accepted == 3.0
    reader._halves[1] = Overtaken(writer, *(Command(1, k, float(k), pack([k])) for k in (4, 5)))
    assert reader.read().accepted == 4.0  # of 2, 4 and half of 5 in the end


def _write(memory, ready):
    shared, value = SharedMemory(memory), 0.0
    ready.set()
    while True:
        value += 1.0
        shared.command.write(Command(1, int(value), value, pack([value] * 32)))


def test_a_process_never_sees_a_mixture_and_a_killed_writer_leaves_a_whole_record():
    context = multiprocessing.get_context("spawn")
    memory, ready = new_memory(), context.Event()
    shared = SharedMemory(memory)
    writer = context.Process(target=_write, args=(memory, ready), daemon=True)
    writer.start()
    try:
        assert ready.wait(30)
        newest, until, reads = 0.0, time.monotonic() + 0.5, 0
        while time.monotonic() < until:
            read = shared.command.read()
            if read is not None:
                assert set(unpack(read.values, 32)) == {read.accepted}
                assert read.accepted >= newest
                newest, reads = read.accepted, reads + 1
        assert reads > 100
        assert newest > 100
    finally:
        writer.kill()
        writer.join(10)
    assert set(unpack(shared.command.read().values, 32)) == {shared.command.read().accepted}
