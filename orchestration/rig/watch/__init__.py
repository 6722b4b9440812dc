"""A live view of a rig in a browser: what its server publishes, and a stop button; nothing else can be commanded."""
