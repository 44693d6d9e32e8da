"""What the server's scripts share: stroll serve as a child, requests as bytes, and a reader of containers that is written
from docs/format.md alone."""
import contextlib
import os
import re
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import traceback

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
import sanitized

STROLL = os.path.abspath(sys.argv[1])
ROOT = os.environ.get("STRL_TEST_ROOT") or os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
GOLDEN = os.path.join(ROOT, "tests", "container", "golden")
PATIENCE_S = 120 # against hanging alone
SECRET = b"nobody outside may read this"


class Server:
    """stroll serve DIR on a free port."""

    connected = 0 # connections so far

    def __init__(self, folder, *options, host="127.0.0.1", **more):
        self.log_file = tempfile.TemporaryFile()
        rate = () if "--rate" in options else ("--rate", "0")
        words = [STROLL, "serve", folder, "--port", "0", "--host", host, *rate, *options]
        self.child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=self.log_file, **more)
        self.host = host
        line = self.child.stdout.readline().decode()
        match = re.fullmatch(r"serving (.*) at http://\S+:(\d+)/\n", line)
        if not match:
            self.child.wait(PATIENCE_S)
            raise AssertionError((line, self.log()))
        assert match[1] == folder
        self.port = int(match[2])

    def log(self):
        self.log_file.seek(0)
        return self.log_file.read().decode()

    def stop(self, number=signal.SIGTERM):
        """Ends as it should: status 0, nothing of a sanitizer's."""
        self.child.send_signal(number)
        status = self.child.wait(PATIENCE_S)
        self.child.stdout.close()
        log = self.log()
        assert status == 0, (status, log[-4000:])
        assert "Sanitizer" not in log and "runtime error" not in log, log[-8000:]
        return log

    def __enter__(self):
        return self

    def __exit__(self, kind, *rest):
        if kind is None and self.child.poll() is None:
            self.stop()
        elif self.child.poll() is None:
            self.child.kill()
            self.child.wait()
        if kind is not None:
            print("--- log\n" + self.log()[-4000:], flush=True)
        self.log_file.close()

    def connect(self, source=None):
        self.connected += 1
        return socket.create_connection((self.host, self.port), PATIENCE_S, source_address=(source, 0) if source else None)

    def get(self, target, method="GET", source=None, **headers):
        return self.ask(head(method, target, **headers), method, source)

    def ask(self, data, method="GET", source=None):
        """One request, one answer."""
        with self.connect(source) as connection:
            connection.sendall(data)
            return read_answer(connection, method)

    def metrics(self):
        answer = self.get("/metrics")
        lines = answer.body.decode().splitlines() if answer.status == 200 else []
        return {line.rsplit(" ", 1)[0][len("stroll_serve_"):]: float(line.rsplit(" ", 1)[1])
                for line in lines if not line.startswith("#")}

    def wait_for(self, name, least):
        """Until a counter is there: a client has its answer before the server has counted it."""
        until(lambda: self.metrics().get(name, 0) >= least, name, least)


class Answer:
    def __init__(self, status, headers, body, whole):
        self.status, self.headers, self.body, self.whole = status, headers, body, whole

    def __repr__(self):
        return f"{self.status} {self.headers} {self.body[:200]!r}{'' if self.whole else ' (cut off)'}"

    def __getitem__(self, name):
        return self.headers.get(name.lower())


def head(method, target, close=True, **headers):
    lines = [f"{method} {target} HTTP/1.1", "Host: test"] + (["Connection: close"] if close else [])
    lines += [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    return ("\r\n".join(lines) + "\r\n\r\n").encode("latin-1")


def read_answer(connection, method="GET", rest=b""):
    """The next answer of a connection; None where it ended without one. What came behind it is in .rest."""
    data = rest
    while b"\r\n\r\n" not in data:
        some = receive(connection)
        if not some:
            assert not data, data
            return None
        data += some
    text, _, data = data.partition(b"\r\n\r\n")
    lines = text.decode("latin-1").split("\r\n")
    status = int(re.fullmatch(r"HTTP/1\.[01] (\d{3}) .*", lines[0])[1])
    headers = {}
    for line in lines[1:]:
        name, _, value = line.partition(": ")
        assert name.lower() not in headers, ("twice", name)
        headers[name.lower()] = value
    assert "transfer-encoding" not in headers
    length = 0 if method == "HEAD" or status in (204, 304) else int(headers["content-length"])
    parts = [data]
    have = len(data)
    while have < length:
        some = receive(connection)
        if not some:
            break
        parts.append(some)
        have += len(some)
    data = b"".join(parts)
    answer = Answer(status, headers, data[:length], have >= length)
    answer.rest = data[length:]
    return answer


def receive(connection):
    try:
        return connection.recv(1 << 16)
    except ConnectionError:
        return b""


def is_ended(connection):
    """Whether the other side has ended it; waits at most PATIENCE_S."""
    ready, _, _ = select.select([connection], [], [], PATIENCE_S)
    return bool(ready) and receive(connection) == b""


def until(claim, *facts):
    """Waits; the clock only bounds the waiting."""
    end = time.monotonic() + PATIENCE_S
    while not claim():
        assert time.monotonic() < end, facts
        time.sleep(0.02)


def check(condition, *facts):
    assert condition, facts


def content(path):
    with open(path, "rb") as file:
        return file.read()


def put(path, data):
    with open(path, "wb") as file:
        file.write(data)
    return data


def age(path, seconds=100):
    """As if it had been written that long ago."""
    then = int(time.time()) - seconds
    os.utime(path, (then, then))


def make_folder(folder):
    """What most tests serve: DIR/served with a container of several treelets, DIR/secret.stroll beside it."""
    served = os.path.join(folder, "served")
    os.makedirs(os.path.join(served, "sub"))
    shutil.copy(os.path.join(GOLDEN, "v1-treelets.stroll"), os.path.join(served, "model.stroll"))
    shutil.copy(os.path.join(GOLDEN, "v1-small.stroll"), os.path.join(served, "sub", "small.stroll"))
    put(os.path.join(folder, "secret.stroll"), SECRET)
    put(os.path.join(folder, "secret.txt"), SECRET)
    for name in ("model.stroll", "sub/small.stroll"):
        age(os.path.join(served, name))
    return served


# ---- a container, by docs/format.md
class Container:
    """Node records, and where the pieces lie that hold them."""

    def __init__(self, data):
        self.data = data
        assert data[:8] == b"STROLL\x1a\n" and struct.unpack_from("<II", data, 8) == (1, 4096)
        self.model_id = data[16:32]
        sections = {}
        for i in range(struct.unpack_from("<I", data, 160)[0]):
            kind, _, count, offset, size = struct.unpack_from("<IIQQI", data, 168 + 40 * i)
            sections[kind] = (count, offset, size)
        count, offset, size = sections[1]
        assert size == 144 * count
        self.trees = [Tree(data, offset + 144 * i) for i in range(count)]


class Tree:
    def __init__(self, data, at):
        self.node_count = struct.unpack_from("<I", data, at + 8)[0]
        self.triangles = struct.unpack_from("<Q", data, at + 96)[0]
        self.treelets = {0: struct.unpack_from("<QI", data, at + 120)}
        self.nodes = {}
        index = 0
        while index in self.treelets: # a treelet names only such as lie behind it
            self.read_treelet(data, *self.treelets[index])
            index += 1
        assert sorted(self.nodes) == list(range(self.node_count))

    def read_treelet(self, data, offset, size):
        first, count, first_child, refs = struct.unpack_from("<IIII", data, offset)
        assert size == 16 + 240 * count + 24 * refs
        for i in range(count):
            at = offset + 16 + 240 * i
            parent, child, children = struct.unpack_from("<IIB", data, at)
            self.nodes[first + i] = {"parent": parent, "children": range(child, child + children) if children else range(0),
                                     "page": struct.unpack_from("<QI", data, at + 208)}
        for i in range(refs):
            self.treelets[first_child + i] = struct.unpack_from("<QI", data, offset + 16 + 240 * count + 24 * i)

    def subtree(self, node, depth):
        found, level = {node}, [node]
        for _ in range(depth):
            level = [child for parent in level for child in self.nodes[parent]["children"]]
            found.update(level)
        return found

    def pieces(self, nodes):
        """(offset, bytes) of what these nodes need, in the order of the file."""
        return sorted({self.treelets[node // 128] for node in nodes} | {self.nodes[node]["page"] for node in nodes})


class Message:
    """The answer to a query, by docs/serve.md."""

    def __init__(self, data):
        magic, version, head_bytes, self.model_id, self.tree, flags, self.node_count, self.next_node, count, zero, size = \
            struct.unpack_from("<8sII16sIIIIIIQ", data)
        assert (magic, version, head_bytes, zero, size) == (b"STROLLQ\n", 1, 64, 0, len(data)), data[:64]
        assert flags in (0, 1)
        self.cut = bool(flags)
        self.records, at = [], head_bytes
        for _ in range(count):
            offset, length = struct.unpack_from("<QI", data, at)
            self.records.append((offset, data[at + 12:at + 12 + length]))
            assert len(self.records[-1][1]) == length
            at += 12 + length
        assert at == len(data)


# ---- running
def run_all(prefix, tests, share=None):
    """Each test gets a folder of its own (and what share makes in another, once)."""
    failed = 0
    with contextlib.ExitStack() as stack:
        shared = [share(stack.enter_context(tempfile.TemporaryDirectory(prefix=prefix)))] if share else []
        for test in tests:
            with tempfile.TemporaryDirectory(prefix=prefix) as folder:
                start = time.monotonic()
                try:
                    test(folder, *shared)
                    print(f"[       OK ] {test.__name__} ({time.monotonic() - start:.1f} s)", flush=True)
                except Exception: # the others are run too
                    failed += 1
                    print(f"[  FAILED  ] {test.__name__}\n{traceback.format_exc()}", flush=True)
    return 1 if failed else 0
