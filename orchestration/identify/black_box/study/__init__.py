"""A black-box study of a record: its columns, the search, the page, and the exported component."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
