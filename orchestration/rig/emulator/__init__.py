"""An emulated rig that shares no code with the models: its physics, effects hidden in it, and records drawn from it."""
