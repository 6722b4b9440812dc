from . import page as page
from .comparison import Deviation as Deviation
from .comparison import Regression as Regression
from .comparison import compare as compare
from .tolerances import Tolerance as Tolerance
from .tolerances import read_tolerances as read_tolerances
