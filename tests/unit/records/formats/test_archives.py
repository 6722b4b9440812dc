"""Claims: a compressed table is read as if it were not; one that is damaged, unpacks to too much or
has several files is refused with the reason.
"""

import bz2
import gzip
import io
import lzma
import zipfile

import pytest

from orchestration.records import read_record
from orchestration.records.formats import archives
from tests.support.record_forms import PLAIN, SIGNALS, check, refusal, write


def zipped(*names):
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name in names:
            archive.writestr(name, PLAIN)
    return content.getvalue()


@pytest.mark.parametrize(
    ("ending", "content"),
    [
        ("gz", gzip.compress(PLAIN.encode(), mtime=0)),
        ("bz2", bz2.compress(PLAIN.encode())),
        ("xz", lzma.compress(PLAIN.encode())),
        ("zip", zipped("r.csv")),
    ],
)
def test_a_compressed_table_is_read(tmp_path, ending, content):
    path = write(tmp_path, content, f"r.csv.{ending}")
    check(read_record(path, SIGNALS))
    path.write_bytes(content[: len(content) // 2])
    assert "the compressed file is damaged" in refusal(path)


def test_several_files_are_refused(tmp_path):
    assert "has 2 files" in refusal(write(tmp_path, zipped("a.csv", "b.csv"), "r.zip"))


def test_what_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "_LARGEST", 1000)
    bomb = gzip.compress(bytes(10**6))
    assert "unpacks to more than" in refusal(write(tmp_path, bomb, "r.csv.gz"))
