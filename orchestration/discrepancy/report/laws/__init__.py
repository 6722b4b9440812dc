"""Presentation of what the laws of a model lack: sentences, figures, a page, JSON and a file."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
