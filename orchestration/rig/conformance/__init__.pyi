from .check import RuleVerdict as RuleVerdict
from .check import check_server as check_server
