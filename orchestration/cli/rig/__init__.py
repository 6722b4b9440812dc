"""The subcommands of ``ppy rig``, a function each."""
