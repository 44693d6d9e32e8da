#!/usr/bin/env python3
"""Byte ranges are enough: nginx, which knows nothing of Stroll, answers them for the same file as our server does.

usage: test_serve_nginx.py PROGRAM"""
import os
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import time

from serving import PATIENCE_S, Server, check, content, make_folder, run_all

NGINX = shutil.which("nginx", path=os.environ.get("PATH", "") + ":/usr/sbin:/usr/local/sbin")
CONFIGURATION = """daemon off;
master_process off;
pid {folder}/pid;
error_log {folder}/error.log;
events {{ }}
http {{
    access_log off;
    default_type application/octet-stream;
    client_body_temp_path {folder}/body;
    proxy_temp_path {folder}/proxy;
    fastcgi_temp_path {folder}/fastcgi;
    uwsgi_temp_path {folder}/uwsgi;
    scgi_temp_path {folder}/scgi;
    server {{
        listen 127.0.0.1:{port};
        root {root};
        add_header Access-Control-Allow-Origin *;
    }}
}}
"""


class Nginx(Server):
    """The same questions to nginx."""

    def __init__(self, served, folder):
        self.host = "127.0.0.1"
        self.log_file = tempfile.TemporaryFile()
        for _ in range(20): # another program may take the port before nginx does
            self.port = free_port()
            with open(folder + "/nginx.conf", "w") as file:
                file.write(CONFIGURATION.format(folder=folder, port=self.port, root=served))
            self.child = subprocess.Popen([NGINX, "-p", folder, "-c", folder + "/nginx.conf"], stderr=self.log_file)
            if self.answers():
                return
        raise AssertionError(self.log())

    def answers(self):
        end = time.monotonic() + PATIENCE_S
        while self.child.poll() is None and time.monotonic() < end:
            try:
                self.connect().close()
                return True
            except ConnectionError:
                time.sleep(0.02)
        return False


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def open_to_all(folder):
    """nginx reads as nobody where it is started by root."""
    for place, folders, files in os.walk(folder):
        os.chmod(place, 0o755)
        for name in files:
            os.chmod(os.path.join(place, name), 0o644)


def ranges_of(size):
    choice = random.Random(4)
    yield from ("0-0", "0-", "-1", "-4096", "0-4095", f"{size - 1}-", f"0-{size + 100}", f"-{size + 100}", f"{size}-", "-0", "9-5", "x")
    for _ in range(50):
        first = choice.randrange(size)
        yield f"{first}-{first + choice.randrange(200000)}"


def a_part_is_the_same_from_nginx(folder):
    served = make_folder(folder)
    data = content(served + "/model.stroll")
    os.mkdir(folder + "/nginx")
    open_to_all(folder)
    with Server(served) as ours, Nginx(served, folder + "/nginx") as theirs:
        both = [server.get("/model.stroll") for server in (ours, theirs)]
        check(all(answer.status == 200 and answer.body == data for answer in both), both)
        check(both[0]["Last-Modified"] == both[1]["Last-Modified"] and both[1]["Accept-Ranges"] == "bytes", both)
        check(both[0]["Access-Control-Allow-Origin"] == both[1]["Access-Control-Allow-Origin"] == "*", both)
        for value in ranges_of(len(data)):
            both = [server.get("/model.stroll", Range="bytes=" + value) for server in (ours, theirs)]
            check(both[0].status == both[1].status in (206, 416), value, both)
            check(both[0]["Content-Range"] == both[1]["Content-Range"], value, both)
            check(both[0].status == 416 or both[0].body == both[1].body, value)
        for server in (ours, theirs):
            tag, date = server.get("/model.stroll", "HEAD")["ETag"], server.get("/model.stroll", "HEAD")["Last-Modified"]
            for headers, status in (({"If_None_Match": tag}, 304), ({"If_Modified_Since": date}, 304), ({"If_Match": '"x"'}, 412),
                                    ({"Range": "bytes=0-9", "If_Range": tag}, 206),
                                    ({"Range": "bytes=0-9", "If_Range": '"x"'}, 200)):
                check(server.get("/model.stroll", **headers).status == status, headers)
        theirs.child.terminate()
        theirs.child.wait(PATIENCE_S)


if not NGINX:
    print("nginx is not installed")
    sys.exit(77)
sys.exit(run_all("stroll-serve-", (a_part_is_the_same_from_nginx,)))
