"""Forward selection of effects: which of them a record asks for, and how it takes its inputs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
