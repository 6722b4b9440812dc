from .experiment import DiscriminatingExperiment as DiscriminatingExperiment
from .experiment import design_experiment as design_experiment
from .stimuli import Limits as Limits
