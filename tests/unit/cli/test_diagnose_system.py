"""``ppy diagnose --system``: what is refused before any work is done."""

from __future__ import annotations

import pytest

from fmus.kit.errors import UserError
from orchestration.cli import diagnose_system


def test_a_folder_is_refused_before_anything_is_read(tmp_path):
    with pytest.raises(UserError, match=r"^--json .*: this is a folder; name a file in it$"):
        diagnose_system.run(tmp_path / "no.csv", tmp_path / "no.ssp", [], [], tmp_path, {})
