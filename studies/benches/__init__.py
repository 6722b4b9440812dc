"""Records of the bench as a system, of a simulation that shares no code with its components."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
