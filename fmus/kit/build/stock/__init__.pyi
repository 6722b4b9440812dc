from .archive import LIMITS as LIMITS
from .archive import check_stock as check_stock
from .archive import stock_archive as stock_archive
