from . import journal as journal
from . import zarr_store as zarr_store
from .journal import SweepJournal as SweepJournal
from .journal import check as check
from .journal import locked_folder as locked_folder
from .traces import iterate_pieces as iterate_pieces
