"""Experiments that the tests of records share."""

from __future__ import annotations

import pytest

from tests.support.rig.small_rig import LEVELS


@pytest.fixture
def experiment(tmp_path):
    def write(duration=1.0, step=0.05, text=LEVELS, name="levels.toml"):
        path = tmp_path / name
        path.write_text(text.format(duration=duration, step=step))
        return path

    return write
