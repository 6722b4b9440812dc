from .front import Front as Front
from .objectives import Objective as Objective
from .objectives import Objectives as Objectives
from .objectives import read_objective as read_objective
from .search import pareto_front as pareto_front
