"""Variables of an FMU with unit and range, and the values that users give to them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
