from .solver import add_solver as add_solver
from .solver import solved as solved
from .translation import Translation as Translation
from .translation import translate as translate
from .variables import MOST_ELEMENTS as MOST_ELEMENTS
from .variables import DeclaredVariable as DeclaredVariable
from .variables import element_names as element_names
from .wrapping import wrap as wrap
