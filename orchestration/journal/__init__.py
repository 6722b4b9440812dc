"""Journal of long work in a folder, from which interrupted work continues."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
