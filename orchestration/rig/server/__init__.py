"""Server of a rig: sessions, safety, watchdog and sampling in real time in front of a backend."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
