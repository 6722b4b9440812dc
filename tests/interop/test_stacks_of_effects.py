"""Claims: descriptions of both versions are valid by schema and fmpy for any stack of effects."""

from __future__ import annotations

import random
from pathlib import Path

import fmpy
import lxml.etree
import pytest
from fmpy.validation import validate_fmu

import fmus
from fmus.kit import UserError, stack
from fmus.kit.build import archive, plan_build

STACKS = 200
SCHEMAS = Path(fmpy.__file__).parent / "schema"
SEED = 36


def schema(path):
    return lxml.etree.XMLSchema(lxml.etree.parse(SCHEMAS / path))


def drawn_stacks(count, seed):
    """Stacks of one to four effects, of components that have some; those that exclude each other
    are drawn again.
    """
    rng = random.Random(seed)
    catalogues = {name: fmus.effects(name) for name in fmus.COMPONENTS if fmus.effects(name)}
    found = []
    while len(found) < count:
        name = rng.choice(list(catalogues))
        effects = catalogues[name]
        chosen = rng.sample(sorted(effects), rng.randint(1, min(4, len(effects))))
        try:
            found.append(stack(fmus.component(name), *(effects[key] for key in chosen)))
        except UserError:
            continue
    return found


def findings(cls, folder):
    """Whatever the schemas and fmpy object to in the builds of both versions."""
    named = {
        2: {"modelDescription.xml": "fmi2/fmi2ModelDescription.xsd"},
        3: {
            "modelDescription.xml": "fmi3/fmi3ModelDescription.xsd",
            "sources/buildDescription.xml": "fmi3/fmi3BuildDescription.xsd",
            "terminalsAndIcons/terminalsAndIcons.xml": "fmi3/fmi3TerminalsAndIcons.xsd",
        },
    }
    for version, schemas in named.items():
        files = plan_build(cls, "native", version).files
        for name, path in schemas.items():
            checker = schema(path)
            if not checker.validate(lxml.etree.fromstring(files[name])):
                yield f"{cls.name}: {checker.error_log}"
        packed = folder / f"{version}.fmu"
        packed.write_bytes(archive.pack(files))
        yield from (f"{cls.name}: {problem}" for problem in validate_fmu(str(packed)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "seed"), [(4, 1), pytest.param(STACKS, SEED, marks=pytest.mark.slow)]
)
@pytest.mark.timeout(1800)
def test_no_finding_over_stacks_of_effects(count, seed, tmp_path):
    problems = [text for cls in drawn_stacks(count, seed) for text in findings(cls, tmp_path)]
    assert problems == []
