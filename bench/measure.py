"""Running the program and noting what the operating system saw. Standard library only."""
import hashlib
import json
import os
import pathlib
import platform
import resource
import statistics
import subprocess
import threading
import time


class Failed(Exception):
    pass


def cpu_model():
    try:
        for line in open("/proc/cpuinfo", encoding="utf-8"):
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.machine()


def system_name():
    try:
        for line in open("/etc/os-release", encoding="utf-8"):
            if line.startswith("PRETTY_NAME="):
                return line.split("=", 1)[1].strip().strip('"')
    except OSError:
        pass
    return platform.system()


def commit_of(root):
    """What git calls the checkout; "unknown" where there is no git or no repository."""
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=10"]
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    except FileNotFoundError:
        return "unknown"
    return done.stdout.strip() or "unknown"


def digest(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def machine(root, program):
    """What every record says. `program` tells two builds apart even where the commit does not."""
    memory_bytes = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return {"commit": commit_of(root), "program": digest(program)[:12],
            "cpu": cpu_model(), "cores": len(os.sched_getaffinity(0)), "memory_gib": round(memory_bytes / 2**30, 1),
            "system": system_name(), "kernel": platform.release()}


class Outcome:
    """What one run of the program did: exit status, output, and the system's account of it."""

    def __init__(self, status, output, errors, seconds, usage):
        self.status, self.output, self.errors, self.seconds = status, output, errors.strip(), seconds
        self.cpu_seconds = usage.ru_utime + usage.ru_stime
        self.peak_rss_bytes = usage.ru_maxrss * 1024
        self.disk_read_bytes = usage.ru_inblock * 512

    def json(self):
        try:
            return json.loads(self.output)
        except json.JSONDecodeError as error:
            raise Failed(f"the program printed no JSON object ({error}): {self.output[:200]!r} {self.errors[:200]}")


def run(command, cores=None, allowed=(0,), limits=None):
    """Runs a command on the first `cores` processors (None = all), under the system's `limits` (a dict from
    resource.RLIMIT_... to a number). Raises Failed at any exit status not allowed; None allows all."""
    words = [str(word) for word in command]
    processors = sorted(os.sched_getaffinity(0))

    def confine():
        if cores:
            os.sched_setaffinity(0, processors[:cores])
        for limit, value in (limits or {}).items():
            resource.setrlimit(limit, (value, value))

    output_file, error_file = os.memfd_create("output"), os.memfd_create("errors")
    start = time.monotonic()
    process = subprocess.Popen(words, stdout=output_file, stderr=error_file, preexec_fn=confine)
    _, wait_status, usage = os.wait4(process.pid, 0)
    seconds = time.monotonic() - start
    process.returncode = os.waitstatus_to_exitcode(wait_status)
    texts = []
    for handle in (output_file, error_file):
        os.lseek(handle, 0, os.SEEK_SET)
        with os.fdopen(handle, "r", encoding="utf-8", errors="replace") as file:
            texts.append(file.read())
    outcome = Outcome(process.returncode, texts[0], texts[1], seconds, usage)
    if allowed is not None and outcome.status not in allowed:
        raise Failed(f"{' '.join(words)} ended with {outcome.status}: {outcome.errors[:500]}")
    return outcome


def disk_bytes(folder):
    """What the scratch files of a folder take; an unfinished output (*.part) is none. 0 where it is not there."""
    try:
        return sum(entry.stat().st_blocks * 512 for entry in os.scandir(folder) if not entry.name.endswith(".part"))
    except OSError:
        return 0


class DiskWatch:
    """The most bytes that the scratch files of a folder took while it was watched."""

    def __init__(self, folder):
        self.folder, self.most_bytes, self.stop = folder, 0, threading.Event()
        self.thread = threading.Thread(target=self.watch, daemon=True)

    def watch(self):
        while not self.stop.wait(0.02):
            self.most_bytes = max(self.most_bytes, disk_bytes(self.folder))

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.stop.set()
        self.thread.join()


def forget_pages(path):
    """The system keeps nothing of the file in memory: who reads it next waits for the disk."""
    with open(path, "rb") as file:
        os.fsync(file.fileno())
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def read_lines(path):
    with open(path, encoding="utf-8") as file:
        return [json.loads(line) for line in file if line.strip()]


def spread(values):
    """Median, quartiles and extremes."""
    ordered = sorted(values)
    if not ordered:
        return {"count": 0}
    quartiles = statistics.quantiles(ordered, n=4, method="inclusive") if len(ordered) > 1 else ordered * 3
    high = ordered[min(len(ordered) - 1, int(len(ordered) * 0.99))]
    return {"count": len(ordered), "median": statistics.median(ordered), "q1": quartiles[0], "q3": quartiles[2],
            "min": ordered[0], "max": ordered[-1], "p99": high}


class Log:
    """JSON lines; the last record of a (measure, model) pair is the valid one."""

    def __init__(self, path, facts):
        self.path, self.facts = pathlib.Path(path), facts
        self.path.parent.mkdir(parents=True, exist_ok=True)

    def add(self, measure, model, settings, **figures):
        record = {"measure": measure, "model": model, "settings": settings, **figures, **self.facts}
        with open(self.path, "a", encoding="utf-8") as file:
            file.write(json.dumps(record) + "\n")
        return record

    def latest(self):
        records = {}
        if self.path.exists():
            for record in read_lines(self.path):
                records[record["measure"], record["model"]] = record
        return records

    def is_current(self, record):
        """Of the program as it is: a commit that changes texts alone makes no record old."""
        return record["program"] == self.facts["program"]

    def has(self, measure, model, settings):
        record = self.latest().get((measure, model))
        return record is not None and self.is_current(record) and record["settings"] == settings
