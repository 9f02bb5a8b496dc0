"""Fixtures that many tests share."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("any machine", deadline=None)  # how long an example takes says nothing on a busy machine
settings.load_profile("any machine")


@pytest.fixture(scope="session")
def dataset() -> Path:
    """The directory of recorded instances (ROBUST_DATASET, or beside the repository); skips the test if absent."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "paper-dataset"
    path = Path(os.environ.get("ROBUST_DATASET") or beside)
    if not path.is_dir():
        pytest.skip(f"no recorded instances at {path}; set ROBUST_DATASET to run this test")
    return path
