"""Claims: the bytes of an archive depend on its contents only."""

import io
import zipfile

from fmus.kit.build import archive


def test_archive_bytes_depend_on_contents_only():
    files = {
        "b.txt": b"2",
        "binaries/linux64/x.so": b"3",
        "modelDescription.xml": b"1",
        "a.txt": b"0",
    }
    packed = archive.pack(files)
    assert packed == archive.pack(dict(reversed(files.items())))
    assert packed != archive.pack(files | {"a.txt": b"1"})
    with zipfile.ZipFile(io.BytesIO(packed)) as read_back:
        assert read_back.testzip() is None
        assert read_back.namelist() == [
            "modelDescription.xml",
            "a.txt",
            "b.txt",
            "binaries/linux64/x.so",
        ]
        assert {name: read_back.read(name) for name in files} == files
        modes = {i.filename: i.external_attr >> 16 for i in read_back.infolist()}
    assert modes["binaries/linux64/x.so"] == 0o100755
    assert modes["a.txt"] == 0o100644
