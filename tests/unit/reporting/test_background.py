"""Claims: a background writer writes in order, waits for what is left, says why it has ended."""

import threading

from orchestration.reporting import BackgroundWriter, background


def test_everything_is_written_in_order_by_another_thread():
    written, threads = [], set()

    def write(content):
        written.append(content)
        threads.add(threading.current_thread())

    writer = BackgroundWriter(write)
    for k in range(100):
        writer.put(b"%d" % k)
    assert writer.close()
    assert written == [b"%d" % k for k in range(100)]
    assert threads.isdisjoint({threading.current_thread()})


def test_nobody_waits_for_a_disk_that_hangs(monkeypatch):
    monkeypatch.setattr(background, "_CLOSE_TIMEOUT", 0.05)
    begun, hangs = threading.Event(), threading.Event()

    def write(content):
        begun.set()
        hangs.wait(30.0)

    writer = BackgroundWriter(write)
    writer.put(b"one")
    assert begun.wait(30.0)
    assert not writer.is_behind
    writer.put(b"two")
    assert writer.is_behind
    assert not writer.close()
    hangs.set()


def test_an_error_ends_it_and_stays():
    written = []

    def write(content):
        if content == b"full":
            raise OSError(28, "No space left on device")
        written.append(content)

    writer = BackgroundWriter(write)
    for content in (b"a", b"full", b"b"):
        writer.put(content)
    assert not writer.close()
    assert written == [b"a"]
    assert writer.error.errno == 28
