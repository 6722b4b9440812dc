"""The other end of the cable: the rig, real or emulated."""
