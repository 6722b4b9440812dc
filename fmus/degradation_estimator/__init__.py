"""Degradation estimator: impedance while the actuator works, and the voltage limit that follows
from it.
"""
