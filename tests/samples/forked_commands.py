"""The command `vsacli` as a fork of a process that has imported everything.

Imports take most of a short command. This is for tests of what commands compute and print; those of starting,
signals, memory and packaging run the installed one.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import pkgutil
import select
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

CLIENT = """#!{python} -IS
import json, os, socket, sys

request = json.dumps([sys.argv[1:], os.getcwd(), dict(os.environ)])
os.chdir({folder!r})  # the path of a socket is short
with socket.socket(socket.AF_UNIX) as server:
    server.connect("socket")
    socket.send_fds(server, [b"."], [0, 1, 2])
    server.sendall(request.encode())
    server.shutdown(socket.SHUT_WR)
    code = int(server.recv(9))
if code < 0:
    os.kill(os.getpid(), -code)
sys.exit(code)
"""

ONE_PROCESS = "--one-process"

FROM_ELSEWHERE = (
    "bokeh.plotting",
    "h5py",
    "matplotlib.backends.backend_agg",
    "matplotlib.pyplot",
    "scipy.optimize",
)
"""Packages that commands import where they need them."""


@contextlib.contextmanager
def command_server(folder: Path, *options: str) -> Iterator[Path]:
    """Serve commands, and yield a folder for the search path, in which a client stands as `vsacli`.

    With the option `ONE_PROCESS` studies start no others, each of which would import everything again,
    unless they are told how many; tests that run at the same time keep the machine busy anyway.
    """
    command = folder / "bin" / "vsacli"
    command.parent.mkdir()
    command.write_text(CLIENT.format(python=sys.executable, folder=str(folder)))
    command.chmod(0o755)
    server = subprocess.Popen(
        [sys.executable, "-P", __file__, *options],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "MPLBACKEND": "agg"},
        start_new_session=True,  # an interrupted test run ends it by closing its standard input
    )
    assert server.stdin
    assert server.stdout
    assert server.stdout.readline() == b"ready\n"
    try:
        yield command.parent
    finally:
        server.stdin.close()
        server.stdout.close()
        server.wait()


def serve(*options: str) -> None:
    """Run commands of clients until standard input is closed."""
    import_everything()
    if ONE_PROCESS in options:
        importlib.import_module("vsacli.studies.sweeps.executors").processor_count = lambda: 1
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("socket")
        server.listen()
        os.write(sys.stdout.fileno(), b"ready\n")
        while sys.stdin not in select.select([server, sys.stdin], [], [])[0]:
            connection, _ = server.accept()
            if os.fork() == 0:
                server.close()
                answer(connection)
            connection.close()
            reap()


def reap() -> None:
    """Let no process of a command that ended remain."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def import_everything() -> None:
    """Import all that a command may, and keep the garbage collector from looking at it in each fork."""
    package = importlib.import_module("vsacli")
    for module in pkgutil.walk_packages(package.__path__, "vsacli."):
        importlib.import_module(module.name)
    for name in FROM_ELSEWHERE:
        importlib.import_module(name)
    gc.freeze()


def answer(connection: socket.socket) -> NoReturn:
    """Execute the command of a client in a process of its own, and send the client its exit code."""
    _, streams, _, _ = socket.recv_fds(connection, 1, 3)
    arguments, folder, environment = json.loads(connection.makefile().read())
    child = os.fork()
    if child == 0:
        connection.close()
        execute(streams, arguments, folder, environment)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    connection.sendall(str(code).encode())
    os._exit(0)


def execute(streams: list[int], arguments: list[str], folder: str, environment: dict[str, str]) -> NoReturn:
    """Become the command: with its streams, arguments, folder and environment."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = ["vsacli", *arguments]
    from vsacli.__main__ import main

    try:
        main()
    except SystemExit as end:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(end.code)  # finalizing all that was imported takes longer than a short command


if __name__ == "__main__":
    serve(*sys.argv[1:])
