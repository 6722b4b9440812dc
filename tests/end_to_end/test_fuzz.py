"""Claim: no damaged file crashes, hangs, takes the memory or is told as an internal error; it is
read, or refused.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import zlib

import pytest

from tests.support import fuzz
from tests.support.source import ROOT

COUNTS = {
    "csv": 150,
    "tdms": 100,
    "nc": 50,
    "toml": 150,
    "fmu": 60,
    "xml": 150,
    "ssp": 30,
    "ssd": 80,
    "2.0.ssd": 80,
    "ssv": 40,
    "mat": 6,
    "parquet": 6,
}


def run(tmp_path, *options):
    told = subprocess.run(
        [sys.executable, "-m", "tests.support.fuzz", *options],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"},
        timeout=500,
    )
    return json.loads(told.stdout), told


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.05, pytest.param(1.0, marks=pytest.mark.slow)])
def test_damaged_files_are_read_or_refused(tmp_path, share):
    counts = {kind: max(1, round(share * count)) for kind, count in COUNTS.items()}
    found, told = run(
        tmp_path, "--seed", "20261122", "--seconds", "300", "--counts", json.dumps(counts)
    )
    assert found["found"] == [], told.stderr
    assert found["done"] == counts
    assert found["memory"] < fuzz.MEMORY


def test_the_files_are_damaged_and_the_same_again():
    data = bytes(range(256)) * 8
    one, two = ([fuzz.damaged(data, random.Random(seed)) for seed in range(200)] for _ in range(2))
    assert one == two
    assert len({zlib.crc32(each) for each in one}) > 190
    assert data not in one[:150] or one.count(data) < 5


@pytest.mark.parametrize(
    ("reads", "told"),
    [
        (lambda path: 1 / 0, "ZeroDivisionError"),
        (lambda path: (_ for _ in ()).throw(fuzz_error("two\nlines")), "more than a line"),
    ],
)
def test_what_is_no_refusal_is_told(reads, told, tmp_path):
    assert fuzz.tried(reads, tmp_path).startswith(told)


def fuzz_error(text):
    from fmus.kit import UserError

    return UserError(text)
