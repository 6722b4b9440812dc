"""The command ``ppy``, which is ``python -m orchestration.cli`` too."""

from orchestration.cli.ending import end_interrupted, end_unloadable


def main() -> None:
    """Import the command line and run it; a Ctrl-C during the import ends as in a command."""
    try:
        from orchestration.cli.app import main as run
    except KeyboardInterrupt:
        end_interrupted()
    except EOFError as error:
        end_unloadable(error)
    run()


if __name__ == "__main__":
    main()
