"""Linear models: a component, an FMU or a system about an operating point, and their properties."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
