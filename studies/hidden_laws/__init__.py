"""Records in which a law depends on a signal in a way that no catalogue has."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
