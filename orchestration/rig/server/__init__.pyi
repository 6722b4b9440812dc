from .front import serve as serve
from .log_chain import verify as verify
from .scheduling import CLIENT as CLIENT
from .scheduling import WATCHDOG as WATCHDOG
from .scheduling import default_watchdog as default_watchdog
from .scheduling import preferred as preferred
from .settings import ServerSettings as ServerSettings
from .settings import read_options as read_options
