"""A web server for tests, on a free port of 127.0.0.1, as slow as it is told and as wrong: byte ranges, ETag, If-Match of one
folder; or a proxy, whose answers are another server's.

    with ShapedServer(folder) as server:
        server.bits_per_second, server.latency = 5e6, 0.08       one link for all connections; seconds before each answer
                                                                 and of each new connection
        server.fault = lambda number, path: "500"                what to do with this answer; None: all is well
        server.kill(); server.restart()
        server.asked                                             [(path, first, last), ...]
    with ShapedServer(upstream=8080) as proxy:                   the same before the server at that port of 127.0.0.1

Faults: a status ("500", "404", ...), "cut" (half of the bytes, then the end), "stall" (half of them, then nothing), "wrong"
(other bytes), "whole" (200, whatever the range), "shifted" (another range). Where a proxy's server cannot be reached the
connection ends without an answer."""
import hashlib
import http.client
import http.server
import pathlib
import re
import socket
import ssl
import threading
import time

CHUNK = 8192
CHUNK_SECONDS = 0.001  # of a fast link, which would else be busy with chunks
CREDIT_SECONDS = 0.005  # that a link catches up with when nobody was there to send
PASSED_ON = ("Range", "If-Match", "If-Unmodified-Since", "If-None-Match", "If-Modified-Since", "If-Range")
OWN_FIELDS = ("content-length", "connection", "date", "server", "keep-alive")


class ShapedServer:
    def __init__(self, folder=None, certificate=None, upstream=None):
        """certificate: (certificate, key), files of PEM; then it speaks https."""
        self.folder, self.upstream = pathlib.Path(folder) if folder else None, upstream
        self.bits_per_second, self.latency, self.fault = 0, 0, None
        self.asked, self.lock, self.link, self.link_is_free_at = [], threading.Lock(), threading.Lock(), 0
        self.port, self.sockets, self.httpd = 0, set(), None
        self.dead, self.certificate = threading.Event(), certificate

    def __enter__(self):
        self.restart()
        return self

    def __exit__(self, *error):
        self.kill()

    def url(self, name):
        return f"http{'s' if self.certificate else ''}://127.0.0.1:{self.port}/{name}"

    def restart(self):
        owner = self

        class Handler(AnswerRange):
            server_of_tests = owner

        class Server(http.server.ThreadingHTTPServer):
            daemon_threads = True
            allow_reuse_address = True

            def handle_error(self, request, address):
                pass  # a client that goes away is no news

        self.dead = threading.Event()
        self.httpd = Server(("127.0.0.1", self.port), Handler)
        self.port = self.httpd.server_address[1]
        if self.certificate:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(*self.certificate)
            self.httpd.socket = context.wrap_socket(self.httpd.socket, server_side=True)
        threading.Thread(target=self.httpd.serve_forever, args=(0.02,), daemon=True).start()

    def kill(self):
        if not self.httpd:
            return
        self.dead.set()
        self.httpd.shutdown()
        self.httpd.server_close()
        with self.lock:
            for sock in self.sockets:
                try:
                    sock.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass
            self.sockets.clear()
        self.httpd = None

    def take_number(self, path, first, last):
        with self.lock:
            self.asked.append((path, first, last))
            return len(self.asked) - 1

    def chunk(self):
        return max(CHUNK, int(self.bits_per_second / 8 * CHUNK_SECONDS))

    def carry(self, size):
        """The time that the link needs, which is everybody's."""
        if not self.bits_per_second:
            return
        with self.link:
            now = time.monotonic()
            self.link_is_free_at = max(self.link_is_free_at, now - CREDIT_SECONDS) + size * 8 / self.bits_per_second
            wait = self.link_is_free_at - now
        if wait > 0:
            time.sleep(wait)


class Gone(Exception):
    """The proxy's server does not answer."""


class AnswerRange(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server_of_tests = None
    upstream = None

    def log_message(self, *words):
        pass

    def setup(self):
        super().setup()
        with self.server_of_tests.lock:
            self.server_of_tests.sockets.add(self.connection)
        time.sleep(self.server_of_tests.latency)

    def finish(self):
        if self.upstream:
            self.upstream.close()
        super().finish()

    def status(self, number, *fields):
        self.send(number, fields, b"told\n")

    def do_GET(self):
        owner = self.server_of_tests
        name = self.path.split("?")[0].lstrip("/")
        found = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        span = (int(found[1]), int(found[2])) if found else None
        number = owner.take_number(name, *(span or (0, None)))
        time.sleep(owner.latency)
        fault = owner.fault(number, name) if owner.fault else None
        if fault and fault.isdigit():
            return self.status(int(fault))
        if fault == "whole":
            span = None
        if fault == "shifted" and span:
            span = (span[0] + 1, span[1])
        try:
            self.send(*(self.relayed(span) if owner.upstream else self.own(name, span)), fault)
        except Gone:
            self.close_connection = True

    def own(self, name, span):
        """Status, fields and body of the folder's file."""
        path = self.server_of_tests.folder / name
        if name == "loop":
            return 302, [("Location", "/loop")], b"told\n"
        if name == "redirect":
            return 302, [("Location", "/" + self.path.split("?")[1])], b"told\n"
        if not path.is_file():
            return 404, [], b"told\n"
        content = path.read_bytes()
        tag = '"' + hashlib.md5(content).hexdigest() + '"'
        if self.headers.get("If-Match", tag) != tag:
            return 412, [], b"told\n"
        if not span:
            return 200, [("ETag", tag)], content
        first, last = span[0], min(span[1], len(content) - 1)
        return 206, [("ETag", tag), ("Content-Range", f"bytes {first}-{last}/{len(content)}")], content[first:last + 1]

    def relayed(self, span):
        """The same of the other server. A connection that has rested may have been closed by it."""
        fields = {name: self.headers[name] for name in PASSED_ON if name in self.headers and (name != "Range" or span)}
        if span:
            fields["Range"] = f"bytes={span[0]}-{span[1]}"
        for _ in range(2 if self.upstream else 1):
            if not self.upstream:
                self.upstream = http.client.HTTPConnection("127.0.0.1", self.server_of_tests.upstream)
            try:
                self.upstream.request("GET", self.path, headers=fields)
                answer = self.upstream.getresponse()
                own = [(name, value) for name, value in answer.getheaders() if name.lower() not in OWN_FIELDS]
                return answer.status, own, answer.read()
            except (OSError, http.client.HTTPException):
                self.upstream.close()
                self.upstream = None
        raise Gone

    def send(self, number, fields, body, fault=None):
        self.send_response(number)
        for name, value in fields:
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if number not in (200, 206):
            fault = None
        if fault == "wrong":
            body = bytes(byte ^ 0x55 for byte in body)
        if fault in ("cut", "stall"):
            body = body[:len(body) // 2]
        step = self.server_of_tests.chunk()
        for at in range(0, len(body), step):
            if self.server_of_tests.dead.is_set():
                break
            self.server_of_tests.carry(len(body[at:at + step]))
            self.wfile.write(body[at:at + step])
        if fault == "stall":
            self.server_of_tests.dead.wait()
        if fault in ("cut", "stall"):
            self.close_connection = True
            self.connection.shutdown(socket.SHUT_RDWR)
