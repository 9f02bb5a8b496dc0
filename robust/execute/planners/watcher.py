"""Runs one planner and ends with it; started by :mod:`robust.execute.planners.process`, in a process group of its own.

`watcher.py REPORT LIFELINE MEMORY COMMAND...`: REPORT and LIFELINE are file descriptors, MEMORY is a limit in bytes for
each process of the planner (0: none). The exit code is written to REPORT. When LIFELINE reaches its end, because the
parent died, the whole group is killed: no planner outlives the program that asked it.
"""

from __future__ import annotations

import os
import resource
import select
import signal
import sys

_LARGEST_FILE = 2**28
"""Bytes; a planner that prints without end is ended before it fills the disk."""


def main() -> None:
    report, lifeline, memory = int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    command = sys.argv[4:]
    for descriptor in (report, lifeline):
        os.set_inheritable(descriptor, False)
    ended, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.set_wakeup_fd(wake)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (_LARGEST_FILE, _LARGEST_FILE))
    if memory:
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    try:
        # Python ignores SIGXFSZ and SIGPIPE, which a child would inherit
        child = os.posix_spawnp(
            command[0], command, os.environ, setsigdef=[signal.SIGCHLD, signal.SIGXFSZ, signal.SIGPIPE]
        )
    except OSError as error:
        print(f"cannot start {command[0]!r}: {error.strerror}", file=sys.stderr)  # noqa: T201 - the planner's stderr
        os.write(report, b"127")
        return
    ready, _, _ = select.select([ended, lifeline], [], [])
    if lifeline in ready:
        os.killpg(0, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    os.write(report, str(os.waitstatus_to_exitcode(status)).encode())


if __name__ == "__main__":
    main()
