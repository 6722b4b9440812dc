"""Presentation of results: on the terminal, as pictures, as interactive plots, on a page."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
