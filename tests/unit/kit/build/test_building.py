import io

import fmpy
import pytest

import fmus
from fmus.kit import UserError, build, stack
from fmus.kit.build import toolchain
from fmus.ppy_actuator.effects import EFFECTS
from tests.support.pace import slow_but


@pytest.mark.parametrize("runtime", slow_but(build.RUNTIMES, "native"))
def test_builds_are_reproducible(runtime, tmp_path, monkeypatch):
    try:
        toolchain.find_compiler(toolchain.host_platform())
    except UserError as error:
        pytest.skip(str(error))
    cls = stack(fmus.component("ppy_actuator"), EFFECTS["quadratic_strain"])
    builds = []
    for cache in "ab":  # neither knows of the other
        monkeypatch.setenv("PPY_CACHE", str(tmp_path / cache))
        builds.append(build.build(cls, runtime, [toolchain.host_platform()]))
    assert builds[0] == builds[1]
    first = builds[0]
    cls.remark = "A remark"
    other = build.build(cls, runtime, [toolchain.host_platform()])
    guids = {fmpy.read_model_description(io.BytesIO(b)).guid for b in (first, other)}
    assert len(guids) == 2


def test_unknown_runtime_is_refused():
    with pytest.raises(UserError, match="unknown runtime 'java'; there are: python, native"):
        build.build(fmus.component("ppy_actuator"), "java")
