from .translation import DeclaredVariable as DeclaredVariable
from .translation import Translation as Translation
from .translation import translate as translate
from .wrapping import wrap as wrap
