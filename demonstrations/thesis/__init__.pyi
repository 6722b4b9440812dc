from . import chapters as chapters
from . import page as page
from .claim import Claim as Claim
