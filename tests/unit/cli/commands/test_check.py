"""Claims: ``ppy check`` tells errors by its exit code."""

import json

from tests.support.archive import edited
from tests.support.command import here


def test_check_tells_errors_by_its_exit_code(fmu, tmp_path):
    spoilt = edited(
        fmu("ppy_actuator", "native"),
        tmp_path / "spoilt.fmu",
        lambda n, c: (
            n,
            c.replace(b"<InitialUnknowns>", b"<InitialUnknowns><Unknown index='9999'/>"),
        ),
    )
    done = here("check", spoilt, fmu("ppy_actuator", "native"), cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert "spoilt.fmu: error (contract line 1)" in done.stdout
    assert "ppy_actuator.fmu: no errors" in done.stdout  # the second file is looked at too


def test_json_of_check(fmu, tmp_path):
    good = fmu("ppy_actuator", "native")
    (answer,) = json.loads(here("check", good, "--json", "-", cwd=tmp_path).stdout)
    assert (answer["file"], answer["errors"], answer["warnings"]) == (str(good), 0, 0)
    assert all(f["severity"] == "note" and isinstance(f["line"], int) for f in answer["findings"])
