from .division import column_labels as column_labels
from .division import divide_at_restarts as divide_at_restarts
from .division import divide_by_label as divide_by_label
from .division import run_labels as run_labels
