"""stroll serve as a second process, on processors of its own."""
import contextlib
import os
import pathlib
import re
import signal
import subprocess

import measure

ROOT = pathlib.Path(__file__).resolve().parent.parent


def processors():
    """How many the walk has (None = all, there is but one) and which the server has."""
    every = sorted(os.sched_getaffinity(0))
    return (len(every) - 1, {every[-1]}) if len(every) > 1 else (None, set(every))


def of_walks():
    every = sorted(os.sched_getaffinity(0))
    return set(every[:-1] or every)


@contextlib.contextmanager
def on_processors(chosen):
    """This thread, and those that it starts meanwhile."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, chosen)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


class Serve:
    """Has one port from its first start on."""

    def __init__(self, stroll, folder, chosen):
        self.stroll, self.folder, self.chosen, self.port, self.child = stroll, folder, chosen, 0, None
        self.log = folder.parent / f"{folder.name}_access.log"

    def start(self, *options):
        self.log.unlink(missing_ok=True)
        words = [self.stroll, "serve", self.folder, "--port", self.port, "--access-log", self.log, *options]
        self.child = subprocess.Popen([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                                      preexec_fn=lambda: os.sched_setaffinity(0, self.chosen))
        found = re.search(r"http://\S+:(\d+)/", self.child.stdout.readline().decode())
        if not found:
            raise measure.Failed(f"stroll serve ended with {self.child.wait()}")
        self.port = int(found[1])

    def kill(self):
        if self.child:
            self.child.send_signal(signal.SIGKILL)
            self.child.wait()
            self.child.stdout.close()
            self.child = None

    def peak_bytes(self):
        with open(f"/proc/{self.child.pid}/status", encoding="ascii") as file:
            return next(int(line.split()[1]) * 1024 for line in file if line.startswith("VmHWM"))

    def logged(self):
        """What its own log says of all requests: answers by status, bytes, milliseconds."""
        fields = [line.split() for line in self.log.read_text(encoding="utf-8").splitlines() if " remark: " not in line]
        return {"requests": len(fields), "refused": sum(not words[-3].startswith("2") for words in fields),
                "bytes": sum(int(words[-2]) for words in fields), "request_ms": measure.spread([float(words[-1]) for words in fields])}
