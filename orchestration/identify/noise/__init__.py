"""The noise of a measured output: its colour, its tails, its likelihood, and whiteness tests."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
