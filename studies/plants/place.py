"""Places of a plant at which something can be hidden: a law, what is done to it, and a signal."""

from __future__ import annotations

from dataclasses import dataclass

_KINDS = {"+": "add", "x": "multiply"}


@dataclass(frozen=True)
class Place:
    """A law and the signal that something hidden in it is a function of.

    Attributes
    ----------
    law : str
    kind : {"add", "multiply"}
        Whether the function is added to the law, or the law is multiplied by one plus it.
    signal : str
    """

    law: str
    kind: str
    signal: str

    @classmethod
    def of(cls, text: str) -> Place:
        """Parse ``friction + angle`` or ``friction x angle``; a bare law is of itself."""
        if " " not in text:
            return cls(text, "add", text)
        law, sign, signal = text.split()
        return cls(law, _KINDS[sign], signal)
