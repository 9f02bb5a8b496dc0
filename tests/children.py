"""Processes in tests: whether they are still running, and Ctrl-C."""

import gc
import signal
import threading
import time
from contextlib import contextmanager, suppress
from pathlib import Path

WAIT = "import time; time.sleep(60)"


def eventually(holds, seconds=10):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if holds():
            return True
        time.sleep(0.02)
    return holds()


def is_running(pid):
    """Whether the process exists and is not only waiting to be collected."""
    with suppress(OSError, IndexError):
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0] != "Z"
    return False


class Told:
    """A file to which a process writes its number: `code` is what it runs, `gone` whether it has ended since."""

    def __init__(self, folder):
        self.path = folder / "pid"
        self.code = f"import os; open({str(self.path)!r}, 'w').write(str(os.getpid())); {WAIT}"

    def begun(self):
        return eventually(lambda: self.path.exists() and self.path.read_text(encoding="utf-8") != "")

    def gone(self):
        pid = int(self.path.read_text(encoding="utf-8"))
        return eventually(lambda: not is_running(pid))


@contextmanager
def interrupted_after(seconds):
    """Ctrl-C, once, from outside of whatever the main thread is doing."""
    main = threading.main_thread().ident
    assert main is not None
    gc.collect()  # finalisers that run before what is interrupted has begun would drop the exception
    timer = threading.Timer(seconds, signal.pthread_kill, (main, signal.SIGINT))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
