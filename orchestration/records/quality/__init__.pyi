from .assessment import assess as assess
from .assessment import check_sizes as check_sizes
from .assessment import resolution_of as resolution_of
from .causality import ahead_of_inputs as ahead_of_inputs
from .fault import FAULTS as FAULTS
from .fault import Channels as Channels
from .fault import Fault as Fault
from .resampling import as_measured as as_measured
