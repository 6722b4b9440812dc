"""Claims: a front has the points that no other dominates, and is a table and JSON."""

import json

import numpy as np

from orchestration.sweeps.pareto import Front
from orchestration.sweeps.pareto.front import undominated


def test_undominated_points_are_those_of_every_pair_compared():
    random = np.random.default_rng(1)
    for _ in range(50):
        values = random.integers(0, 6, (12, 2)).astype(float)
        expected = []
        for k, one in enumerate(values.tolist()):
            beaten = any(
                all(b >= a for a, b in zip(one, other, strict=True)) and other != one
                for other in values.tolist()
            )
            expected.append(not beaten and one not in values[:k].tolist())
        assert undominated(values).tolist() == expected


def test_a_front_is_a_table_and_json(bells):
    front = Front.of(bells, np.array([[0.5, 0.5], [0.55, 0.55], [0.9, 0.1]]))
    assert front.maximised == (False, False)
    assert front.values.shape == (2, 2), "the third point is worse"
    assert (front.values >= 0.0).all()
    assert "as it is" in str(front)
    assert list(front.to_frame().columns) == ["one", "two", "x", "y"]
    told = json.loads(json.dumps(front.to_dict()))
    assert [p["parameters"]["x"] for p in told["points"]] == front.parameters["x"].tolist()
    assert told["nominal"] == front.nominal.tolist()
