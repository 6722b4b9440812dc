"""The rig, the other end of the cable: which model stands for it and what it can be driven with.

So far there is one to practise on, :mod:`orchestration.rig.emulator`.
"""

DRIVEN = "ppy_actuator"  # the component that is on it
# What it can be driven with, SI: the galvanostat's currents, what a film bears, and the bandwidth of both loops in Hz.
LIMITS = {"current": (-1.3, 1.3), "force": (0.0, 3.0)}
HIGHEST = 30.0
