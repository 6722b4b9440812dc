"""Records in which a law hangs on a signal in a way that no catalogue has, by equations of their own."""
