from .wrapping import WrappedFmu as WrappedFmu
from .wrapping import corrected_system as corrected_system
from .wrapping import wrap as wrap
