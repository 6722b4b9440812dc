"""Line 4, continued: an FMU works wherever it is unzipped, however the host spells that place."""

from __future__ import annotations

import shutil
from pathlib import Path
from urllib.parse import quote

import pytest

from tests.contract.raw import Instance, Library, unzipped
from tests.contract.subjects import each_front_end


@each_front_end
@pytest.mark.parametrize(
    "folder", ["plain", "with space", "größe äöü", "a+b#c", "100%", "%41", "quote'\"", "日本"]
)
def test_folder_with_any_name(archive, tmp_path, folder):
    with unzipped(archive) as original:
        place = tmp_path / folder
        shutil.copytree(original, place)
    before = sorted(place.rglob("*"))
    with Instance(Library(place)) as one:
        assert one.component is not None, one.messages
        one.initialize()
        one.step(0.1)
    assert sorted(place.rglob("*")) == before, "nothing is written into the unzipped FMU"


def spellings(resources: Path) -> dict[str, str]:
    path = quote(str(resources))
    return {
        "uri": f"file://{path}",
        "uri with a host": f"file://localhost{path}",
        "uri with one slash": f"file:{path}",
        "uri with a slash at its end": f"file://{path}/",
        "plain path": str(resources),
    }


@each_front_end
@pytest.mark.parametrize("spelling", spellings(Path("/")))
def test_any_spelling_of_the_resource_location(archive, spelling):
    with unzipped(archive) as folder:
        location = spellings(folder / "resources")[spelling]
        with Instance(Library(folder), resources=location.encode()) as one:
            assert one.component is not None, one.messages
            one.initialize()
            one.step(0.1)
