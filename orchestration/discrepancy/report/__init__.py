"""Presentation of a diagnosis: its page, its text on a terminal, its JSON and its wording."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
