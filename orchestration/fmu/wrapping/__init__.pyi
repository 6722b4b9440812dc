from .translation import MOST_ELEMENTS as MOST_ELEMENTS
from .translation import DeclaredVariable as DeclaredVariable
from .translation import Translation as Translation
from .translation import element_names as element_names
from .translation import translate as translate
from .wrapping import wrap as wrap
