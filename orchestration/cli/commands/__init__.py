"""What each command takes, a module a command; its heavy imports happen when it is called."""
