from .blocks import LinearBlocks as LinearBlocks
from .blocks import blocks_of as blocks_of
from .discretisation import assemble as assemble
from .operating_point import OperatingPoint as OperatingPoint
from .operating_point import point_at as point_at
from .trim import TrimRequest as TrimRequest
from .trim import trim as trim
