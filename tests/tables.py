"""Tables of examples and texts, in the folder `data` beside their tests."""

import json
from pathlib import Path


def text_in_data(file, name):
    return Path(file).with_name("data").joinpath(name).read_text(encoding="utf-8")


def tables(file):
    """Those of a test file, by name: `data/region.json` for `test_region.py`, a row for each example."""
    return json.loads(text_in_data(file, f"{Path(file).stem.removeprefix('test_')}.json"))
