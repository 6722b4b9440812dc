"""Version of the package, and the error that its functions raise."""

from importlib.metadata import version

from fmus.kit import UserError as UserError

__version__ = version("ppy-rig")
