"""What commands change in their process and tests must not inherit."""

import logging

import pytest


@pytest.fixture(autouse=True)
def _fresh_process(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    yield
    logger = logging.getLogger("robust")
    logger.handlers.clear()
    logger.setLevel(logging.NOTSET)
