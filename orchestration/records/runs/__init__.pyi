from .division import divide_at_restarts as divide_at_restarts
from .division import divide_by_label as divide_by_label
from .division import run_labels as run_labels
from .joining import MeasuredRun as MeasuredRun
from .joining import base_name as base_name
from .joining import join_records as join_records
from .joining import sampled_alike as sampled_alike
