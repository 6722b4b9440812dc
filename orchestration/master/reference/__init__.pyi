from .coupling_error import Mechanical as Mechanical
from .coupling_error import imbalance as imbalance
from .coupling_error import mechanical as mechanical
from .fused import fuse as fuse
