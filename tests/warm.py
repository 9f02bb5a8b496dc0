"""`robust` without its start: a server that has imported the package forks a process for each command line.

`python -I -S tests/warm.py SOCKET WORD ...` is then what `robust WORD ...` is: it has the directory, the variables and
the streams of whoever runs it. What a start imports, and signals, are tested with processes that start.
"""

import marshal
import os
import socket
import sys

FAILED = 70
"""The exit code of a command whose process has ended without one."""


def ask(path, words):
    """Have a command line run by the server at that path, and wait for its exit code."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as server:
        server.connect(path)
        socket.send_fds(server, [marshal.dumps((words, os.getcwd(), dict(os.environ)))], [0, 1, 2])
        return int(server.recv(9) or FAILED)


def serve(path):
    """Import all of the package, say so by a line, and run what is asked until the process is ended."""
    from contextlib import suppress  # noqa: PLC0415 - those who ask are to start at once
    from importlib import import_module  # noqa: PLC0415
    from pkgutil import walk_packages  # noqa: PLC0415

    import robust  # noqa: PLC0415

    for module in walk_packages(robust.__path__, "robust."):
        if not module.name.endswith("__main__"):
            with suppress(ImportError):  # of an extra
                import_module(module.name)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listening:
        listening.bind(path)
        listening.listen()
        os.write(1, b"ready\n")
        children = set()
        while True:
            asking, _ = listening.accept()
            with asking:
                message, streams, _, _ = socket.recv_fds(asking, 2**20, 3)
                children.add(os.fork() or answer(asking, message, streams))
            for stream in streams:
                os.close(stream)
            children -= {child for child in children if os.waitpid(child, os.WNOHANG)[0]}


def answer(asking, message, streams):
    """Be the process that runs the command line."""
    import traceback  # noqa: PLC0415

    from robust.cli import run  # noqa: PLC0415

    words, directory, variables = marshal.loads(message)  # noqa: S302 - from `ask`
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w")  # noqa: SIM115 - as at a start
    os.chdir(directory)
    os.environ.clear()
    os.environ.update(variables)
    code = FAILED
    try:
        code = run(words)
    except SystemExit as ended:
        code = ended.code or 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        asking.send(str(code).encode())
        os._exit(0)


if __name__ == "__main__":
    sys.exit(ask(sys.argv[1], sys.argv[2:]))
