"""Black-box identification: discrete-time models of one output and several inputs (Ljung, 1999)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
