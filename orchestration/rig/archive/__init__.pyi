from .layout import Gap as Gap
from .layout import columns_of as columns_of
from .reading import Archive as Archive
from .reading import Span as Span
from .writing import ArchiveWriter as ArchiveWriter
