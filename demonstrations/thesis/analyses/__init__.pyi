from . import charge_displacement as charge_displacement
from . import creep as creep
from . import excitation as excitation
from . import impedance as impedance
from . import potentiostat as potentiostat
