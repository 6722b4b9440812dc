"""Claims: of what was typed, the longest name that a model has is taken."""

from __future__ import annotations

import random

import pytest

from orchestration.fmu.signal.names import join_names, split_assignment

PIECES = ("a", "b", "=", " = ", ",", ", ", "[1]", "(", ")", '"')


@pytest.mark.parametrize(
    ("text", "known", "split"),
    [
        ("u=3", ["u"], ("u", "3")),
        (" u = 3 ", ["u"], ("u", "3")),
        ("u = 1=3", ["u", "u = 1"], ("u = 1", "3")),
        ("u=1 =3", ["u", "u = 1"], ("u = 1", "3")),
        ("u = 1", ["u", "u = 1"], ("u", "1")),
        ("path=a=b", ["path"], ("path", "a=b")),
        ("nobody=3", [], ("nobody", "3")),
        ("u", ["u"], None),
    ],
)
def test_an_assignment_is_split_after_the_longest_name(text, known, split):
    assert split_assignment(text, known) == split


def test_names_of_any_pieces_come_back():
    draw = random.Random(8)
    for _ in range(300):
        names = {"".join(draw.choices(PIECES, k=draw.randint(1, 5))).strip(" ,=") for _ in range(4)}
        known = sorted(name for name in names if name)
        for name in known:
            split = split_assignment(f"{name}=3", known)
            assert split is not None
            assert "".join(split[0].split()) == "".join(name.split())
        chosen = draw.sample(known, len(known))
        words = [word.strip() for word in ",".join(chosen).split(",")]
        joined = ",".join(join_names(words, known))
        assert joined.replace(" ", "") == ",".join(chosen).replace(" ", "")


def test_words_between_commas_are_the_longest_names_and_others_stand_for_themselves():
    assert join_names(["a", "b", "a", "c"], ["a", "a, b"]) == ["a, b", "a", "c"]
