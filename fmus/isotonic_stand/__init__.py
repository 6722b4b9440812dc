"""Vertical test stand: weights on an actuator, and an LVDT that measures its displacement."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..kit.registry import ComponentPackage
from .systems import EXAMPLES, ISOTONIC_STAND

if TYPE_CHECKING:
    from .model import IsotonicStand

__all__ = ["IsotonicStand"]
PACKAGE = ComponentPackage(
    components={"isotonic_stand": "fmus.isotonic_stand.model:IsotonicStand"},
    declared_systems=(ISOTONIC_STAND,),
    examples=EXAMPLES,
    experiment_folder=Path(__file__).with_name("experiments"),
)
__getattr__ = PACKAGE.offered
