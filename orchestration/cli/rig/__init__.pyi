from . import bridge as bridge
from . import demo as demo
from . import keys as keys
from . import operate as operate
from . import record as record
from . import serve as serve
from . import watch as watch
