"""Diagnosis of simulation models against measured records, and FMI components of a rig.

>>> import orchestration as ppy
>>> record = ppy.read_record("hidden.csv", model="ppy_actuator")  # doctest: +SKIP
>>> result = ppy.diagnose(record, model="ppy_actuator")  # doctest: +SKIP
>>> print(result)  # doctest: +SKIP

Importing this package is cheap: a name is loaded when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
