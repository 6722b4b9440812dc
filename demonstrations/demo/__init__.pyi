from . import everything as everything
from . import on_rig as on_rig
