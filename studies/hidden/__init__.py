"""Records in which an effect is hidden, by equations that share nothing with the catalogue."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
