"""Archive of a rig: a bounded ring of files with its samples, commands, states and events."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
