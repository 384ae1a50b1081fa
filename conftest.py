"""Settings for the tests and the examples in docstrings: one BLAS thread, no screen, the same random cases each time."""

import os
import sys

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ["MPLBACKEND"] = "Agg"

import hypothesis

hypothesis.settings.register_profile("steady", deadline=None, derandomize=True, max_examples=40)
hypothesis.settings.load_profile("steady")


def pytest_xdist_auto_num_workers(config):
    """The whole suite on all cores, file by file; what is named on the command line in this process."""
    return None if config.args_source is pytest.Config.ArgsSource.TESTPATHS else 0


@pytest.fixture(autouse=True)
def _no_figures_left():
    """Figures of pyplot that a test or an example has opened are closed after it."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
