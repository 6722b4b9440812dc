from .reading import read as read
from .vocabulary import ENDINGS as ENDINGS
from .writing import write as write
