"""The potentiostat-galvanostat that drives the actuator, with the voltage protection of thesis
section 4.2.
"""

from typing import TYPE_CHECKING

from ..kit.registry import ComponentPackage
from .systems import EXAMPLES

if TYPE_CHECKING:
    from .model import Galvanostat

__all__ = ["Galvanostat"]
PACKAGE = ComponentPackage(
    components={"galvanostat": "fmus.galvanostat.model:Galvanostat"}, examples=EXAMPLES
)
__getattr__ = PACKAGE.offered
