from . import picture as picture
from . import terminal as terminal
from . import wording as wording
from .page import diagnosis_page as diagnosis_page
from .summary import diagnosis_summary as diagnosis_summary
from .tables import TriedEffect as TriedEffect
from .tables import tried_effects as tried_effects
