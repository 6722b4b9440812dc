from .measured import estimate_responses as estimate_responses
from .measured import parts_of_ratio as parts_of_ratio
from .measured import unit_of_ratio as unit_of_ratio
from .response import Response as Response
from .result import FrequencyResponse as FrequencyResponse
