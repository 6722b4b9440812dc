"""The emulated rig in time: it is driven sample by sample, as a real one is, instead of over a whole record."""
