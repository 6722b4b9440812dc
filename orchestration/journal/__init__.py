"""Journal of long work in a folder: what is done is kept, so that interrupted work goes on."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
