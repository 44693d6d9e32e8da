"""A web server of one folder for tests, on a free port of 127.0.0.1: byte ranges, ETag, If-Match; as slow as it is told, and
as wrong.

    with ShapedServer(folder) as server:
        server.bits_per_second, server.latency = 5e6, 0.08       one link for all connections; seconds before each answer
        server.fault = lambda number, path: "500"                what to do with this answer; None: all is well
        server.kill(); server.restart()
        server.asked                                             [(path, first, last), ...]

Faults: a status ("500", "404", ...), "cut" (half of the bytes, then the end), "stall" (half of them, then nothing), "wrong"
(other bytes), "whole" (200, whatever the range), "shifted" (another range)."""
import hashlib
import http.server
import pathlib
import re
import socket
import ssl
import threading
import time

CHUNK = 8192


class ShapedServer:
    def __init__(self, folder, certificate=None):
        """certificate: (certificate, key), files of PEM; then it speaks https."""
        self.folder = pathlib.Path(folder)
        self.bits_per_second, self.latency, self.fault = 0, 0, None
        self.asked, self.lock, self.link = [], threading.Lock(), threading.Lock()
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

    def carry(self, size):
        """The time that the link needs, which is everybody's."""
        if self.bits_per_second:
            with self.link:
                time.sleep(size * 8 / self.bits_per_second)


class AnswerRange(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server_of_tests = None

    def log_message(self, *words):
        pass

    def setup(self):
        super().setup()
        with self.server_of_tests.lock:
            self.server_of_tests.sockets.add(self.connection)

    def status(self, number, *fields):
        self.send_response(number)
        for name, value in fields:
            self.send_header(name, value)
        self.send_header("Content-Length", "5")
        self.end_headers()
        self.wfile.write(b"told\n")

    def do_GET(self):
        owner = self.server_of_tests
        name = self.path.split("?")[0].lstrip("/")
        path = owner.folder / name
        found = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        first, last = (int(found[1]), int(found[2])) if found else (0, None)
        number = owner.take_number(name, first, last)
        time.sleep(owner.latency)
        fault = owner.fault(number, name) if owner.fault else None
        if fault and fault.isdigit():
            return self.status(int(fault))
        if name == "loop":
            return self.status(302, ("Location", "/loop"))
        if name == "redirect":
            return self.status(302, ("Location", "/" + self.path.split("?")[1]))
        if not path.is_file():
            return self.status(404)
        content = path.read_bytes()
        tag = '"' + hashlib.md5(content).hexdigest() + '"'
        if self.headers.get("If-Match", tag) != tag:
            return self.status(412)
        self.send_file(content, tag, None if fault == "whole" else found and (first, min(last, len(content) - 1)), fault)

    def send_file(self, content, tag, span, fault):
        first, last = span or (0, len(content) - 1)
        if fault == "shifted":
            first += 1
        self.send_response(206 if span else 200)
        self.send_header("ETag", tag)
        if span:
            self.send_header("Content-Range", f"bytes {first}-{last}/{len(content)}")
        self.send_header("Content-Length", str(last + 1 - first))
        self.end_headers()
        body = content[first:last + 1]
        if fault == "wrong":
            body = bytes(byte ^ 0x55 for byte in body)
        if fault in ("cut", "stall"):
            body = body[:len(body) // 2]
        for at in range(0, len(body), CHUNK):
            if self.server_of_tests.dead.is_set():
                break
            self.server_of_tests.carry(len(body[at:at + CHUNK]))
            self.wfile.write(body[at:at + CHUNK])
        if fault == "stall":
            self.server_of_tests.dead.wait()
        if fault in ("cut", "stall"):
            self.close_connection = True
            self.connection.shutdown(socket.SHUT_RDWR)
