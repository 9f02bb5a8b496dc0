"""Fixtures that many tests share."""

import gc
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import settings

# How long an example takes says nothing on a busy machine. A change is judged by the same examples each time (`.ci/run`
# sets CI), so that it is the change that breaks them; everybody else draws new ones.
settings.register_profile("any machine", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("any machine")

# Lines of answers are as wide as where there is no terminal, whoever runs the tests.
os.environ.pop("COLUMNS", None)

# Processes that tests start would compile the package each time, which takes as long as many tests.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


def pytest_configure(config):
    """Where slow tests run as well, the others draw more examples: see `tests.sampling.often`."""
    if config.option.markexpr != "not slow":
        os.environ["ROBUST_THOROUGH"] = "yes"


def pytest_collection_finish():
    """All tests and what they import stay until the end: garbage collection need not look at them again and again."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _signals_stay_as_they_were():
    """No test leaves a signal blocked: later ones would wait for interruptions that never come."""
    usual = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    yield
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == usual


@pytest.fixture(scope="session")
def dataset():
    """The directory of recorded instances (ROBUST_DATASET, or beside the repository); skips the test if absent."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "paper-dataset"
    path = Path(os.environ.get("ROBUST_DATASET") or beside)
    if not path.is_dir():
        pytest.skip(f"no recorded instances at {path}; set ROBUST_DATASET to run this test")
    return path


@pytest.fixture(scope="session")
def warm(tmp_path_factory):
    """The first words of a command line that is run as `robust` would, without its start; see `tests.warm`."""
    path = str(tmp_path_factory.mktemp("warm") / "server")
    code = f"from tests.warm import serve; serve({path!r})"
    folder = Path(__file__).resolve().parents[1]
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, cwd=folder) as server:
        assert server.stdout is not None
        assert server.stdout.readline() == b"ready\n"
        yield (sys.executable, "-I", "-S", str(Path(__file__).with_name("warm.py")), path)
        server.kill()
