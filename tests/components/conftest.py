"""Systems in a master that is not ours."""

import pytest

from orchestration.system import library, ssp
from tests.support.system.hosts import run_libcosim_ssp


@pytest.fixture
def libcosim(tmp_path):
    """Run a system in libcosim for some seconds, at its step divided by a number."""

    def run(name, seconds, inputs, signals, part=1):
        system, path = library.system(name), tmp_path / f"{name}.ssp"
        if not path.exists():
            ssp.write(system, path)
        step = system.step / part
        return run_libcosim_ssp(path, step, round(seconds / step), inputs, signals)

    return run
