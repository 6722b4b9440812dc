"""Claims: a test that takes more processor time than the limit fails, unless it is marked slow;
linear algebra takes no other processor than that of its test.
"""

from __future__ import annotations

import pytest
import scipy.linalg
import threadpoolctl

from tests.support.processor_time import ProcessorTimeLimit

TESTS = """
    import subprocess, sys, threading, time
    import pytest

    BURN = "import time\\nwhile time.process_time() < 0.1: pass"

    def burn(seconds=0.1):
        end = time.process_time() + seconds
        while time.process_time() < end:
            pass

    @pytest.fixture(scope="module")
    def costly():
        burn()

    @pytest.fixture
    def ends_late():
        yield
        burn()

    @pytest.fixture(scope="module")
    def shared():
        yield
        burn()

    def test_sleeps():
        time.sleep(0.4)

    @pytest.mark.slow
    def test_is_marked():
        burn()

    def test_burns():
        burn()

    def test_burns_and_fails():
        burn()
        assert False

    def test_burns_in_a_child():
        subprocess.run([sys.executable, "-c", BURN], check=True)

    def test_burns_in_a_thread():
        thread = threading.Thread(target=burn)
        thread.start()
        thread.join()

    def test_is_the_first_to_need_a_costly_fixture(costly):
        pass

    def test_is_the_second_to_need_it(costly):
        pass

    def test_imports():
        import costly_module

    def test_ends_late(ends_late):
        pass

    def test_is_the_last_to_need_a_fixture_that_ends_late(shared):
        pass
"""
OVER = {
    "test_burns",
    "test_burns_in_a_child",
    "test_burns_in_a_thread",
    "test_ends_late",
    "test_is_the_first_to_need_a_costly_fixture",
}


@pytest.mark.slow
def test_a_fast_test_that_takes_long_fails(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_costs=TESTS)
    pytester.makepyfile(costly_module="from test_costs import burn\nburn()")
    pytester.makeini("[pytest]\nmarkers = slow")
    without = ("-p", "no:cacheprovider", "-p", "no:zarr")
    run = pytester.inline_run(*without, plugins=[ProcessorTimeLimit(0.04)])
    reports = run.getreports("pytest_runtest_logreport")
    failed = {r.nodeid.partition("::")[2]: r for r in reports if r.failed}
    assert failed.pop("test_burns_and_fails").when == "call", "it fails for its own reason alone"
    assert set(failed) == OVER
    for name, report in failed.items():
        assert f"::{name} took 0." in report.longrepr
        assert report.longrepr.endswith("a fast test has 0.04 s: make it quicker, or mark it slow")


def test_linear_algebra_has_one_thread():
    scipy.linalg.inv([[1.0]])  # loads its own and that of numpy
    libraries = threadpoolctl.threadpool_info()
    assert {found["num_threads"] for found in libraries if found["user_api"] == "blas"} == {1}
