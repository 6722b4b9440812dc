from .check import Verdict as Verdict
from .check import check_server as check_server
