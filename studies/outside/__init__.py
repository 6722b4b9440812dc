"""Records of five plants whose truth is half inside and half outside of what a search knows."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
