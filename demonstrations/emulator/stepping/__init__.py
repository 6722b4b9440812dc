"""The emulated rig in time: driven sample by sample as a real one, not over a whole record."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
