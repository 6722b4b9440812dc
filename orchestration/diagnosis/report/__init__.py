"""Words, figures and curves of a diagnosis; nothing is decided here."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
