"""Signals that a law may hang on, as they are or as they are remembered."""

from __future__ import annotations

from dataclasses import dataclass, replace

MEMORIES = ("", "lagged", "leading", "heat", "integrated", "throughput")
LAGS = "lagged", "leading", "heat"
_FAMILIES = {
    "": "over {}",
    "heat": "over temperature",
    "throughput": "over throughput",
}  # others remember


@dataclass(frozen=True)
class Of:
    """A signal that a law hangs on.

    Attributes
    ----------
    name : str
        Input, state, law, or ``time``.
    memory : {"", "lagged", "leading", "heat", "integrated", "throughput"}
        What is remembered of it: behind a lag of first order, itself less that, its square behind a lag, as heat is,
        integrated, or integrated in modulus.
    constant : float
        Time constant of the lag, s.
    unit : str
        SI unit of the signal itself.
    scale : float
        Typical magnitude of what is remembered.
    start : float
        What is remembered at first.
    zero : float
        From which shapes count what is remembered: an absolute temperature never comes near nothing.
    """

    name: str
    memory: str = ""
    constant: float = 0.0
    unit: str = "1"
    scale: float = 1.0
    start: float = 0.0
    zero: float = 0.0

    @property
    def label(self) -> str:
        """For people."""
        by = f" by {self.constant:.3g} s" if self.constant else ""
        words = {
            "lagged": f" lagged{by}",
            "leading": f" less itself lagged{by}",
            "heat": f" squared, lagged{by}",
            "integrated": " integrated",
            "throughput": " integrated in modulus",
        }
        return self.name + words.get(self.memory, "")

    @property
    def words(self) -> str:
        """The same without the constant, which is a parameter of what hangs on it."""
        return replace(self, constant=0.0).label

    @property
    def counted(self) -> str:
        """What stands for x in a shape."""
        return self.words + (f" less {self.zero:g}" if self.zero else "")

    @property
    def unit_of_memory(self) -> str:
        """SI unit of what is remembered."""
        if self.memory in ("integrated", "throughput"):
            return "s" if self.unit == "1" else f"({self.unit})*s"
        if self.memory == "heat" and self.unit != "1":
            return f"({self.unit})^2"
        return self.unit


def family(law: str, signal: str, memory: str = "") -> str:
    """Family of effects of a law and a signal, as :class:`~fmus.kit.component.Term` has it.

    What is heated has a temperature, and what passed is a throughput, whatever signal they are of.
    """
    return f"{law} {_FAMILIES.get(memory, 'remembering {}').format(signal)}"
