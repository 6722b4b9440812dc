from .columns import columns_of as columns_of
from .reading import Archive as Archive
from .reading import read_date as read_date
from .writing import ArchiveWriter as ArchiveWriter
