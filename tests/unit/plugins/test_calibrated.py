"""Base of backends of a calibration: its signals as the server wants them."""

from __future__ import annotations

from pathlib import Path

import pytest

from fmus.kit.errors import UserError
from fmus.kit.registry import presets
from orchestration.plugins.calibrated import Calibrated
from orchestration.rig.backends.registry import open_backend


class Bare(Calibrated):
    def read(self) -> dict[str, float]:
        return {}

    def write(self, values: object) -> None: ...

    def safe(self) -> None: ...

    def close(self) -> None: ...


def test_signals_limits_and_safe_values_are_those_of_the_file() -> None:
    bare = Bare("thesis_generator")
    assert (bare.inputs, bare.outputs) == ({"current": "A"}, {"voltage": "V"})
    assert (bare.limits["current"].min, bare.limits["current"].max) == (-1.3, 1.3)
    assert bare.safe_values == {"current": 0.0}
    assert bare._volts({"current": 0.5}) == {"current": 0.5}
    with pytest.raises(UserError, match="command current = missing"):
        bare._volts({})


def test_a_heartbeat_without_a_line_for_it_is_refused(tmp_path: Path) -> None:
    text = presets()["thesis_generator"].read_text(encoding="utf-8")
    path = tmp_path / "rig.toml"
    path.write_text(text.replace("[rig]", '[rig]\nheartbeat = "port0/line7"'), encoding="utf-8")
    with pytest.raises(UserError, match=r"\[rig\] heartbeat = 'port0/line7': there is no such li"):
        Bare(str(path))


def test_a_calibration_that_is_not_there_is_told() -> None:
    for backend in ("visa", "nidaqmx", "serial"):
        with pytest.raises(UserError, match=f"^backend {backend}: none: no such calibration file"):
            open_backend(backend, {"calibration": "none"})
