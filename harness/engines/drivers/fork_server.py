"""Starts runs of a driver as copies of this process, which has loaded the engine: ``fork_server.py LINK driver.py [arguments]``.

Plain Python, as it runs inside other programs. LINK is the descriptor of a socket that keeps messages apart. A message is a JSON object
(``cwd``, ``env``) with three descriptors, the run's standard streams; the copy answers with its process number once it leads a
new session. A second message, of any content, asks for how it ended: exit status as `os.waitstatus_to_exitcode` reports it, CPU
seconds. Until then it is not reaped, so that its number stays its own. When the link closes, this process ends, and a run in hand with it.

Each run is the driver from its first line, in a process that no other run has touched; only what its imports load is there before.
"""

import gc
import json
import os
import runpy
import signal
import socket
import sys
import tempfile
from contextlib import suppress

LARGEST = 1 << 20


def main():
    """Load what the driver imports, then serve; returns in copies of this process, where the driver is to run."""
    link = socket.socket(fileno=int(sys.argv[1]))
    sys.argv[:] = sys.argv[2:]
    if not getattr(sys.flags, "safe_path", False):
        sys.path[0] = os.path.dirname(sys.argv[0])  # as where it is the script itself
    loaded = runpy.run_path(sys.argv[0], init_globals=GIVEN, run_name="driver")
    loaded.get("preload", int)()
    del loaded
    gc.collect()
    gc.freeze()  # a copy's collections would write to, and so copy, all that is loaded
    running = 0
    try:
        while True:
            text, streams, _, _ = socket.recv_fds(link, LARGEST, 3)
            if not text:
                return True
            sys.stdout.flush()
            sys.stderr.flush()
            running = os.fork()
            if not running:
                become_run(link, json.loads(text), streams)
                return False
            for stream in streams:
                os.close(stream)
            if not link.recv(LARGEST):
                return True
            _, status, used = os.wait4(running, 0)
            running = 0
            link.send(json.dumps([os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime]).encode())
    except OSError:  # nobody is there any more
        return True
    finally:
        if running:
            with suppress(OSError):
                os.killpg(running, signal.SIGKILL)


def become_run(link, asked, streams):
    """Make this copy what a process is that was just started for the run."""
    os.setsid()
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(asked["cwd"])
    os.environ.clear()
    os.environ.update(asked["env"])
    tempfile.tempdir = None
    link.send(str(os.getpid()).encode())
    link.close()


GIVEN = {
    name: value for name, value in globals().items() if not name.startswith("__")
}  # YADE gives its names to a script
if main():
    os._exit(0)
runpy.run_path(sys.argv[0], init_globals=GIVEN, run_name="__main__")
# All is said and written: what the interpreter takes apart at its end is copied first.
sys.stdout.flush()
sys.stderr.flush()
os._exit(0)
