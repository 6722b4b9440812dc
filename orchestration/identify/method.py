"""How far a fit goes."""

from __future__ import annotations

from dataclasses import dataclass

# Trial points of a fit without colour that is begun once more: the coloured one goes on from where it has come to.
BRIEF = 12


@dataclass(frozen=True)
class Method:
    """How a fit is made; as it stands, quickly, and to far below what any evidence turns on.

    Attributes
    ----------
    tolerance : float
        Fall of the sum of squared innovations that ends a search.
    passes : int
        Of fitting with a noise model and estimating the noise model from the residual, at most.
    settled : float
        Fall of BIC from one pass to the next that ends them.
    trials : int
        Points that a pass may try.
    again : int
        How often a fit is begun again without the colour of the noise, at most.
    """

    tolerance: float = 0.05
    passes: int = 3
    settled: float = 0.5
    trials: int = 200
    # one or two do where the model can follow the record, and where it cannot, as with a wrong unit, each gains a
    # little and dozens would follow
    again: int = 4


FULLY = Method()
ALIKE = Method(again=0)  # in a colour that is known, so that there is none to do without
GLANCE = Method(
    passes=1, trials=BRIEF, again=0
)  # how far a fit goes that only tells whether to make it
AS_IT_STANDS = Method(passes=1, trials=1, again=0)
