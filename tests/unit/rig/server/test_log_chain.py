"""Claims: a line that is changed, put in, taken out or moved later is found.

The oracle of the digests is hashlib.
"""

from __future__ import annotations

from hashlib import sha256

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.server.log import EventLog
from orchestration.rig.server.log_chain import verify


@pytest.fixture
def lines(tmp_path):
    log = EventLog(tmp_path / "rig.log")
    for number in range(5):
        log.tell(f"event {number}")
    log.close()
    return (tmp_path / "rig.log").read_text().splitlines()


def verified(tmp_path, lines):
    (tmp_path / "other.log").write_text("".join(f"{line}\n" for line in lines))
    return verify([tmp_path / "other.log"])


def test_each_line_has_the_digest_of_the_one_before_and_of_itself(tmp_path, lines):
    digest = 16 * "0"
    for line in lines:
        text, _, shown = line.rpartition(" #")
        digest = sha256(f"{digest}\n{text}".encode()).hexdigest()[:16]
        assert shown == digest
    assert verified(tmp_path, lines) == 6


@pytest.mark.parametrize(
    ("change", "number"),
    [
        (lambda lines: [*lines[:2], lines[2].replace("event 1", "event 7"), *lines[3:]], 3),
        (lambda lines: [*lines[:2], *lines[3:]], 3),
        (lambda lines: [*lines[:2], lines[1], *lines[2:]], 3),
        (lambda lines: [*lines[:2], lines[3], lines[2], *lines[4:]], 3),
        (lambda lines: [*lines[:5], "2026-01-02 an event of somebody"], 6),
        (lambda lines: lines[1:], 1),
    ],
    ids=["changed", "taken out", "twice", "exchanged", "without a digest", "without its beginning"],
)
def test_what_was_not_written_so_is_found(tmp_path, lines, change, number):
    with pytest.raises(UserError, match=rf"other\.log, line {number}: the chain is broken here"):
        verified(tmp_path, change(lines))


def test_a_file_that_is_none_is_refused(tmp_path):
    with pytest.raises(UserError, match="No such file"):
        verify([tmp_path / "none"])
