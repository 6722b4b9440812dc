"""The one exception a user is meant to see."""


class UserError(ValueError):
    """A mistake in what the user gave us, told in one readable line.

    The text names what is wrong, where (file, row, column or variable), which value was found and what is allowed.
    The command line prints it and exits with code 2; no traceback reaches the user.
    """
