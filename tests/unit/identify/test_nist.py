"""Claims: certified values of nonlinear regression are met to six digits, from either start.

Oracle: Statistical Reference Datasets of NIST, nonlinear regression: data, certified values and
certified sums of squares, in which a line of the data that was typed wrongly would show.
"""

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, exp
from orchestration.identify.fitting import Assumptions, FitData
from orchestration.identify.grey_box import fit_records


class Saturation(Component):
    """Misra1a, BoxBOD."""

    name = "saturation"
    b1 = Parameter(1.0, "1", min=0)
    b2 = Parameter(1.0, "1", min=0)
    x = Input("1")

    @Output("1")
    def y(self):
        return self.b1 * (1.0 - exp(-self.b2 * self.x))


class Logistic(Component):
    """Rat42."""

    name = "logistic"
    b1 = Parameter(1.0, "1", min=0)
    b2 = Parameter(1.0, "1")
    b3 = Parameter(1.0, "1", min=0)
    x = Input("1")

    @Output("1")
    def y(self):
        return self.b1 / (1.0 + exp(self.b2 - self.b3 * self.x))


class Richards(Component):
    """Rat43."""

    name = "richards"
    b1 = Parameter(1.0, "1", min=0)
    b2 = Parameter(1.0, "1")
    b3 = Parameter(1.0, "1", min=0)
    b4 = Parameter(1.0, "1", min=0)
    x = Input("1")

    @Output("1")
    def y(self):
        return self.b1 * (1.0 + exp(self.b2 - self.b3 * self.x)) ** (-1.0 / self.b4)


class Rational(Component):
    """MGH09."""

    name = "rational"
    b1 = Parameter(1.0, "1", min=0)
    b2 = Parameter(1.0, "1", min=0)
    b3 = Parameter(1.0, "1", min=0)
    b4 = Parameter(1.0, "1", min=0)
    x = Input("1")

    @Output("1")
    def y(self):
        x = self.x
        return self.b1 * (x**2 + x * self.b2) / (x**2 + x * self.b3 + self.b4)


class Peak(Component):
    """Eckerle4."""

    name = "peak"
    b1 = Parameter(1.0, "1", min=0)
    b2 = Parameter(1.0, "1", min=0)
    b3 = Parameter(1.0, "1", min=0)
    x = Input("1")

    @Output("1")
    def y(self):
        return self.b1 / self.b2 * exp(-0.5 * ((self.x - self.b3) / self.b2) ** 2)


# class, x, y, both starts, certified values, certified sum of squares
PROBLEMS = {
    "Misra1a": (
        Saturation,
        "77.6 114.9 141.1 190.8 239.9 289.0 332.8 378.4 434.8 477.3 536.8 593.1 689.1 760.0",
        "10.07 14.73 17.94 23.93 29.61 35.18 40.02 44.82 50.76 55.05 61.01 66.40 75.47 81.78",
        ((500.0, 1e-4), (250.0, 5e-4)),
        (2.3894212918e02, 5.5015643181e-04),
        1.2455138894e-01,
    ),
    "BoxBOD": (
        Saturation,
        "1 2 3 5 7 10",
        "109 149 149 191 213 224",
        ((1.0, 1.0), (100.0, 0.75)),
        (2.1380940889e02, 5.4723748542e-01),
        1.1680088766e03,
    ),
    "Rat42": (
        Logistic,
        "9 14 21 28 42 57 63 70 79",
        "8.93 10.80 18.59 22.33 39.35 56.11 61.73 64.62 67.08",
        ((100.0, 1.0, 0.1), (75.0, 2.5, 0.07)),
        (7.2462237576e01, 2.6180768402e00, 6.7359200066e-02),
        8.0565229338e00,
    ),
    "Rat43": (
        Richards,
        "1 2 3 4 5 6 7 8 9 10 11 12 13 14 15",
        "16.08 33.83 65.80 97.20 191.55 326.20 386.87 520.53 590.03 651.92 724.93 699.56 689.96"
        " 637.56 717.41",
        ((100.0, 10.0, 1.0, 1.0), (700.0, 5.0, 0.75, 1.3)),
        (6.9964151270e02, 5.2771253025e00, 7.5962938329e-01, 1.2792483859e00),
        8.7864049080e03,
    ),
    "MGH09": (
        Rational,
        "4 2 1 0.5 0.25 0.167 0.125 0.1 0.0833 0.0714 0.0625",
        "0.1957 0.1947 0.1735 0.1600 0.0844 0.0627 0.0456 0.0342 0.0323 0.0235 0.0246",
        ((25.0, 39.0, 41.5, 39.0), (0.25, 0.39, 0.415, 0.39)),
        (1.9280693458e-01, 1.9128232873e-01, 1.2305650693e-01, 1.3606233068e-01),
        3.0750560385e-04,
    ),
    "Eckerle4": (
        Peak,
        "400 405 410 415 420 425 430 435 436.5 438 439.5 441 442.5 444 445.5 447 448.5 450 451.5"
        " 453 454.5 456 457.5 459 460.5 462 463.5 465 470 475 480 485 490 495 500",
        "0.0001575 0.0001699 0.0002350 0.0003102 0.0004917 0.0008710 0.0017418 0.0046400 0.0065895"
        " 0.0097302 0.0149002 0.0237310 0.0401683 0.0712559 0.1264458 0.2073413 0.2902366 0.3445623"
        " 0.3698049 0.3668534 0.3106727 0.2078154 0.1164354 0.0616764 0.0337200 0.0194023 0.0117831"
        " 0.0074357 0.0022732 0.0008800 0.0004579 0.0002345 0.0001586 0.0001143 0.0000710",
        ((1.0, 10.0, 500.0), (1.5, 5.0, 450.0)),
        (1.5543827178e00, 4.0888321754e00, 4.5154121844e02),
        1.4635887487e-03,
    ),
}


def numbers(text):
    return np.array(text.split(), dtype=float)


@pytest.mark.parametrize("start", [0, 1])
@pytest.mark.parametrize("name", PROBLEMS)
def test_certified_values_are_met(name, start):
    cls, x, y, starts, certified, squares = PROBLEMS[name]
    names = [f"b{k}" for k in range(1, 1 + len(certified))]
    data = FitData(np.arange(len(numbers(y))) * 1.0, {"x": numbers(x)}, {"y": numbers(y)})
    begin = dict(zip(names, starts[start], strict=True))
    fit = fit_records(cls, [data], names, begin, Assumptions(loss="squares", starts=None))
    residual = fit.likelihood.fitted.residual["y"]
    assert float(residual @ residual) == pytest.approx(squares, rel=1e-9)
    assert [fit.values[name] for name in names] == pytest.approx(certified, rel=5e-7)
