from . import page as page
from .characterisation import Characterisation as Characterisation
from .characterisation import characterise as characterise
from .files import WRITTEN as WRITTEN
from .files import write_files as write_files
from .kinds import KINDS as KINDS
from .kinds import Kind as Kind
from .kinds import kind_of as kind_of
