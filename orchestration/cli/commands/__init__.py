"""Commands of ``ppy``, a module each, which imports what is heavy when the command is called."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
