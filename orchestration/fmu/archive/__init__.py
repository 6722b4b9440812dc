"""Archives of FMUs and of systems, from anybody: opened and read within bounds."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
