"""Drives a rig with the inputs of an experiment, without any model, and records what it does."""
