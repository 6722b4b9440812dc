"""``python -m orchestration.cli`` is ``ppy``."""

from orchestration.cli.app import main

main()
