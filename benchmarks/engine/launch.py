"""Runs one command and reports its exit code, time and peak memory; started by :mod:`benchmarks.engine.measure`.

`launch.py REPORT LIFELINE LIMIT COMMAND...`: REPORT and LIFELINE are file descriptors, LIMIT is in seconds (0: none).
The command is killed at the limit. When LIFELINE reaches its end, because the parent closed it or died, everything
this process started ends with it. It runs in a process group of its own.

A separate small process, because Linux counts the memory of the parent at the time of the fork in the `ru_maxrss` of
the child: started from a process of 400 MB, every command would seem to need that much.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import time


def main() -> None:
    report, lifeline, limit = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    command = sys.argv[4:]
    for descriptor in (report, lifeline):
        os.set_inheritable(descriptor, False)
    ended, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.set_wakeup_fd(wake)
    signal.signal(signal.SIGCHLD, lambda *_: None)

    started = time.perf_counter()
    child = os.posix_spawn(command[0], command, os.environ, setsigdef=[signal.SIGCHLD])
    ready, _, _ = select.select([ended, lifeline], [], [], limit or None)
    if lifeline in ready:
        os.killpg(0, signal.SIGKILL)
    timed_out = not ready
    if timed_out:
        os.kill(child, signal.SIGKILL)
    _, status, usage = os.wait4(child, 0)
    seconds = time.perf_counter() - started
    result = {
        "exit_code": os.waitstatus_to_exitcode(status),
        "timed_out": timed_out,
        "seconds": seconds,
        "cpu_s": usage.ru_utime + usage.ru_stime,
        "memory_bytes": usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024),
    }
    os.write(report, json.dumps(result).encode())
    os.close(report)
    if timed_out:
        os.killpg(0, signal.SIGKILL)  # whatever the command has started as well


if __name__ == "__main__":
    main()
