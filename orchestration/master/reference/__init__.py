"""What co-simulation is held against: the laws of all members as one model, without communication steps."""
