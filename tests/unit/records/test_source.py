"""Claims: data are a source that is read as it stands, and a source is one already."""

from pathlib import Path

from orchestration.records import Source


def test_data_become_a_source_with_what_is_stated():
    source = Source.of("r.csv", rate=10.0)
    assert source.data == Path("r.csv")
    assert source.reading.rate == 10.0
    assert source.reading.discard == 1.0
    assert Source.of(source) is source
