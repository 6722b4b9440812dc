"""Live page of a rig in a browser: its signals and events, and a stop button, its only command."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
