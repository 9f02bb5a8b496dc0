"""Runs one command, and ends it with everything that it has started; run as a program by :mod:`robust.processes`.

`watcher.py REPORT LIFELINE MEMORY FOLDER COMMAND...`: REPORT and LIFELINE are file descriptors, MEMORY is a limit in
bytes for each process (0: none). When the command ends, or LIFELINE can be read because the parent wrote to it or died,
all descendants are killed: on Linux also those that have left the command's session, since orphans become children of
this process; elsewhere its process group. Then the exit code, the wall and the processor time in seconds and the
greatest memory in bytes are written to REPORT. If the parent has died, FOLDER (if not empty) is removed in its place.

A separate small process, because Linux counts the memory of the parent at the time of the fork in the `ru_maxrss` of
the child: started from a process of 400 MB, every command would seem to need that much.
"""

import contextlib
import ctypes
import os
import resource
import select
import shutil
import signal
import sys
import time
from typing import NoReturn

_LARGEST_FILE = 2**28
"""Bytes; a command that writes without end is ended before it fills the disk."""
CANNOT_START = 127
"""The exit code of a command that could not be started, as in a shell; the last line that it prints says why."""
_AGAIN = 0.005
"""Seconds."""
_DIE_WITH_PARENT, _ADOPT_ORPHANS = 1, 36
"""PR_SET_PDEATHSIG and PR_SET_CHILD_SUBREAPER of Linux's `prctl`."""


def main() -> None:
    report, lifeline, memory = map(int, sys.argv[1:4])
    folder = sys.argv[4]
    for descriptor in (report, lifeline):
        os.set_inheritable(descriptor, False)
    children = f"/proc/self/task/{os.getpid()}/children"
    linux = sys.platform == "linux" and os.path.exists(children)
    control = ctypes.CDLL(None).prctl if linux else lambda *_: 0
    control(_ADOPT_ORPHANS, 1, 0, 0, 0)
    ended, wake = os.pipe()
    for descriptor in (ended, wake):
        os.set_blocking(descriptor, False)
    signal.set_wakeup_fd(wake)
    signal.signal(signal.SIGCHLD, lambda *_: None)

    started = time.perf_counter()
    child = os.fork()
    if child == 0:
        control(_DIE_WITH_PARENT, signal.SIGKILL, 0, 0, 0)
        _become(sys.argv[5:], memory)
    waited = 0
    while not waited and lifeline not in select.select([ended, lifeline], [], [])[0]:
        os.read(ended, 64)
        waited, status, usage = os.wait4(child, os.WNOHANG)
    if not waited:
        os.kill(child, signal.SIGKILL)
        _, status, usage = os.wait4(child, 0)
    with contextlib.suppress(ChildProcessError, ProcessLookupError, PermissionError):  # nobody is left
        while linux:
            with open(children, encoding="ascii") as file:
                for orphan in file.read().split():
                    os.kill(int(orphan), signal.SIGKILL)
            if os.wait4(-1, os.WNOHANG)[0] == 0:
                time.sleep(_AGAIN)  # the list may lack a child while another one ends
        os.killpg(child, signal.SIGKILL)
    if folder and _has_died(lifeline):
        shutil.rmtree(folder, ignore_errors=True)
    bytes_ = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    facts = (os.waitstatus_to_exitcode(status), time.perf_counter() - started, usage.ru_utime + usage.ru_stime, bytes_)
    with contextlib.suppress(BrokenPipeError):  # nobody wants to know
        os.write(report, " ".join(map(str, facts)).encode())


def _has_died(lifeline: int) -> bool:
    """Whether the parent has died; one that lives writes before it closes its end, and may not have done either."""
    return lifeline in select.select([lifeline], [], [], 0)[0] and not os.read(lifeline, 1)


def _become(command: list[str], memory: int) -> NoReturn:
    """Run the command in place of this process, which Python has made ignore some signals."""
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (_LARGEST_FILE, _LARGEST_FILE))
        if memory:
            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        for number in (signal.SIGXFSZ, signal.SIGPIPE):
            signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, ())
        os.execvp(command[0], command)  # noqa: S606 - no shell is meant
    except OSError as error:
        os.write(2, f"cannot start {command[0]!r}: {error.strerror}\n".encode())
    finally:
        os._exit(CANNOT_START)


if __name__ == "__main__":
    main()
