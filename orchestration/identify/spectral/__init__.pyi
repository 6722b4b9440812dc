from .measured import estimate_responses as estimate_responses
from .response import Response as Response
from .result import FrequencyResponse as FrequencyResponse
