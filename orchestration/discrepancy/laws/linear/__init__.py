"""Unknown inputs to laws, and responses to them to first order along a simulated course."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
