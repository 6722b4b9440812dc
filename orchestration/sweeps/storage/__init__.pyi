from . import zarr_store as zarr_store
from .journal import SweepJournal as SweepJournal
from .traces import iterate_pieces as iterate_pieces
