"""The small components and every component of ours, alone and with all its effects: what goes for
any model.
"""

import pytest

import fmus
from fmus.kit import stack
from tests.support.kit_samples import Curved, Divider, Doubled, Thermostat, Wall, Warmer
from tests.support.pace import slow_but

GUID = "{12345678-1234-1234-1234-123456789012}"
MODELS = [
    Thermostat,
    Divider,
    Curved,
    Wall,
    stack(Thermostat, Warmer, Doubled),
    *map(fmus.component, fmus.COMPONENTS),
    *(
        stack(fmus.component(name), *fmus.effects(name).values())
        for name in fmus.COMPONENTS
        if fmus.effects(name)
    ),
]
every_model = pytest.mark.parametrize("cls", MODELS, ids=lambda cls: cls.name)
# Those of which each has something that no other has; small ones, one with samples and one with a
# large body
TELLING = [
    *MODELS[:5],
    *(
        cls
        for cls in MODELS[5:]
        if cls.name.startswith(("voice_coil_dma_with", "foot_dynamic_with"))
    ),
]
telling_models = pytest.mark.parametrize(
    "cls", slow_but(MODELS, *TELLING), ids=lambda cls: cls.name
)
