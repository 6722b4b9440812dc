"""The rig's server: sessions, safety, watchdog and real-time sampling in front of a backend."""
