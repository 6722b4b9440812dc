"""File formats: a reader for each, which returns a raw `Table`."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
