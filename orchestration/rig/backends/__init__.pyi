from .backend import Backend as Backend
from .backend import Limit as Limit
from .backend import Steppable as Steppable
from .backend import place as place
from .registry import backend_class as backend_class
from .registry import device_names as device_names
from .registry import open_backend as open_backend
