"""The other end of the cable: the rig, real or emulated."""

DRIVEN = "ppy_actuator"
# What it can be driven with, SI: the galvanostat's currents, what a film bears, and the bandwidth of both loops in Hz.
LIMITS = {"current": (-1.3, 1.3), "force": (0.0, 3.0)}
HIGHEST = 30.0
