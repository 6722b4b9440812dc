"""What a simulation gets wrong, why, and what is gained by mending it."""
