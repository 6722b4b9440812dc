"""Voice-coil dynamic mechanical analyzer: the force bench of the rig."""
