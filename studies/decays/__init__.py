"""Records of systems that nothing drives: they settle from a state that nobody wrote down.

They are simulated by SciPy and share no code with the models under test, which fit the clean ones
and lack a law that is hidden in the others.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
