"""Presentation of results: text on the terminal, pictures, and pages and charts in HTML."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
