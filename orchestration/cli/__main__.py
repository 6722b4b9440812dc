"""The command ``ppy``, which is ``python -m orchestration.cli`` too."""

from orchestration.cli.ending import end_interrupted, end_unloadable


def main() -> None:
    """Import the command line, a Ctrl-C or a fault during which is one as later, and run it."""
    try:
        from orchestration.cli.app import main as run
    except KeyboardInterrupt:
        end_interrupted()
    except EOFError as error:
        end_unloadable(error)
    run()


if __name__ == "__main__":
    main()
