"""The forms that files come in, a reader for each; all yield the same raw table."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
