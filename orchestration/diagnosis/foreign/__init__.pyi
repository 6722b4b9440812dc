from .component import reals as reals
from .diagnosis import FmuDiagnosis as FmuDiagnosis
from .diagnosis import diagnose_fmu as diagnose_fmu
from .system import corrected_system as corrected_system
