"""What a server can stand in front of: one file each, with one small interface (:mod:`.backend`)."""
