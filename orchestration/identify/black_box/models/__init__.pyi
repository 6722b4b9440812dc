from .identified import IdentifiedModel as IdentifiedModel
from .polynomial import PolynomialModel as PolynomialModel
from .state_space import StateSpaceModel as StateSpaceModel
from .state_space import free_responses as free_responses
from .state_space import states as states
