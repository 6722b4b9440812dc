"""Black-box identification: discrete-time models of one output and several inputs (Ljung, 1999)."""

from orchestration.identify.black_box.data import InputOutputData, input_output_data
from orchestration.identify.black_box.excitation import autocovariance_matrix, pexcit
from orchestration.identify.black_box.models.linear import LinearModel
from orchestration.identify.black_box.models.polynomial import PolynomialModel
from orchestration.identify.black_box.models.state_space import StateSpaceModel
from orchestration.identify.black_box.order_search import OrderSearch, Row, search_orders
from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.polynomials import s_plane
from orchestration.identify.black_box.residual_tests import (
    CrossCorrelation,
    ResidualTests,
    residual_tests,
)
from orchestration.identify.black_box.result import Identification, Parameter
from orchestration.identify.black_box.structures import armax, arx, box_jenkins, output_error
from orchestration.identify.black_box.subspace import state_space

__all__ = [
    "CrossCorrelation",
    "Identification",
    "InputOutputData",
    "LinearModel",
    "OrderSearch",
    "Orders",
    "Parameter",
    "PolynomialModel",
    "ResidualTests",
    "Row",
    "StateSpaceModel",
    "armax",
    "arx",
    "autocovariance_matrix",
    "box_jenkins",
    "input_output_data",
    "output_error",
    "pexcit",
    "residual_tests",
    "s_plane",
    "search_orders",
    "state_space",
]
