"""Voice-coil dynamic mechanical analyzer: the force bench of the rig."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..kit.registry import ComponentPackage
from .systems import DMA_BENCH, EXAMPLES, PROTECTED_BENCH

if TYPE_CHECKING:
    from .model import VoiceCoilDma

__all__ = ["VoiceCoilDma"]
PACKAGE = ComponentPackage(
    components={"voice_coil_dma": "fmus.voice_coil_dma.model:VoiceCoilDma"},
    declared_systems=(DMA_BENCH, PROTECTED_BENCH),
    examples=EXAMPLES,
    experiment_folder=Path(__file__).with_name("experiments"),
)
__getattr__ = PACKAGE.offered
