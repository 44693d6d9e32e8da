"""Builds that are stopped on the way: when to stop them is told by the checkpoints that they make, not by the clock."""
import os
import subprocess
import time

from building import STROLL


class Watched:
    """A build whose checkpoints are counted while it runs: the rename of each gives the file another inode or time."""

    def __init__(self, *words):
        self.scratch = words[words.index("-o") + 1] + ".tmp"
        self.seen, self.last = 0, self.identity()
        self.child = subprocess.Popen([STROLL, "build", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def identity(self):
        try:
            facts = os.stat(os.path.join(self.scratch, "checkpoint"))
        except OSError:
            return None
        return facts.st_ino, facts.st_mtime_ns

    def wait_for(self, checkpoints, deadline=120):
        """Until so many were seen, or the build is over. Whether it still runs."""
        end = time.monotonic() + deadline
        while self.child.poll() is None and self.seen < checkpoints:
            assert time.monotonic() < end, "the build does not go on"
            now = self.identity()
            if now and now != self.last:
                self.seen, self.last = self.seen + 1, now
            else:
                time.sleep(0.0005)
        return self.child.poll() is None

    def stop(self, number):
        """Its standard error, or None where it was over before."""
        self.child.send_signal(number)
        _, error = self.child.communicate(timeout=120)
        return None if self.child.returncode == 0 else error
