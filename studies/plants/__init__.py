"""Plants that records are drawn of, each once: equations from textbooks and the thesis.

They share no code with the models under test. A plant without hidden changes is the clean one.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
