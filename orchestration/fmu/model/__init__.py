"""Models by name: components, classes in users' files, FMU files, and effects added to them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
