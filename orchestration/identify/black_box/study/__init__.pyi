from .columns import read_columns as read_columns
from .component import class_name as class_name
from .component import identifiers as identifiers
from .identification import BlackBox as BlackBox
from .identification import study as study
