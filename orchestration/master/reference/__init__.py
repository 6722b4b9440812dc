"""References for co-simulation: the fused system, without communication steps, and the error."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
