"""Ctrl-C as a terminal sends it: the children end, the results so far are reported."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.bench.conftest import MakeSuite, Stand, navigation
from tests.bench.test_process import eventually, is_running

DRIVER = """
import json, sys
from pathlib import Path
from robust.bench import process
process.COMMAND = (sys.executable, sys.argv[1])
from robust.bench.recorded import run_recorded
print(json.dumps(run_recorded(Path(sys.argv[2]), jobs=int(sys.argv[3])).as_dict()))
"""


@pytest.mark.parametrize("jobs", [1, 2])
def test_sigint(make_suite: MakeSuite, stand: Stand, tmp_path: Path, jobs: int) -> None:
    script = stand(
        f"""
if sys.argv[-2] == "--order=quick": print(json.dumps(ANSWER)); sys.exit()
open({str(tmp_path)!r} + f"/pid{{os.getpid()}}", "w").close()
time.sleep(60)
"""
    )
    slow = (navigation(f"slow{i}", irr_order=["slow"]) for i in range(4))
    suite = make_suite(navigation("quick", irr_order=["quick"]), *slow)
    command = [sys.executable, "-c", DRIVER, str(script), str(suite), str(jobs)]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as driver:
        assert eventually(lambda: len(list(tmp_path.glob("pid*"))) == jobs, 30)
        driver.send_signal(signal.SIGINT)
        output, errors = driver.communicate(timeout=30)
    assert driver.returncode == 0, errors
    assert errors == ""
    report = json.loads(output)
    assert report["complete"] is False
    assert [row["instance"] for row in report["rows"]] == ["quick"]
    for path in tmp_path.glob("pid*"):
        assert eventually(lambda pid=int(path.name[3:]): not is_running(pid))
