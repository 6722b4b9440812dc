"""Variables of an FMU with units and ranges, and the values that users set."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
