from .front import serve as serve
from .settings import ServerSettings as ServerSettings
from .settings import read_options as read_options
