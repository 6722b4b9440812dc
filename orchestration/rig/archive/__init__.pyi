from .columns import columns_of as columns_of
from .layout import Gap as Gap
from .reading import Archive as Archive
from .reading import Span as Span
from .reading import read_date as read_date
from .writing import ArchiveWriter as ArchiveWriter
