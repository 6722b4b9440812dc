from .data import dataset as dataset
from .data import empty_dataset as empty_dataset
from .data import units as units
from .driving import RecordingObserver as RecordingObserver
from .driving import drive as drive
from .planning import RecordingPlan as RecordingPlan
from .planning import plan_recording as plan_recording
