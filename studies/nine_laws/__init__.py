"""Nine laws outside of every catalogue, each hidden in a plant that is integrated by SciPy.

They share no code with what they judge.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
