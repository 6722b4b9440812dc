from . import picture as picture
from . import terminal as terminal
from . import wording as wording
from .page import diagnosis_page as diagnosis_page
from .summary import diagnosis_summary as diagnosis_summary
from .system import system_diagnosis_summary as system_diagnosis_summary
from .system import system_overview as system_overview
