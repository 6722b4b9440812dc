"""Reference results of both actuators, from an independent solution."""
