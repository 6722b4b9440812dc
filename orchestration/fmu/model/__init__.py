"""Models by name: components, classes in files of users, FMU files, and effects laid over them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
