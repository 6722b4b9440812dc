from .archive import LIMITS as LIMITS
from .archive import stock_archive as stock_archive
