#!/usr/bin/env python3
"""Byte ranges are enough: nginx, which knows nothing of Stroll, answers them for the same file as our server does, and a walk
reads them over TLS and HTTP/2.

usage: test_serve_nginx.py PROGRAM"""
import os
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import time

from serving import PATIENCE_S, STROLL, Server, check, content, make_folder, run_all

NGINX = shutil.which("nginx", path=os.environ.get("PATH", "") + ":/usr/sbin:/usr/local/sbin")
CONFIGURATION = """daemon off;
master_process off;
pid {folder}/pid;
error_log {folder}/error.log;
events {{ }}
http {{
    log_format asked "$server_protocol $connection $msec $request_time";
    access_log {folder}/asked.log asked;
    default_type application/octet-stream;
    client_body_temp_path {folder}/body;
    proxy_temp_path {folder}/proxy;
    fastcgi_temp_path {folder}/fastcgi;
    uwsgi_temp_path {folder}/uwsgi;
    scgi_temp_path {folder}/scgi;
    server {{
        listen 127.0.0.1:{port}{more};
        root {root};
        add_header Access-Control-Allow-Origin *;
    }}
}}
"""


class Nginx(Server):
    """The same questions to nginx."""

    def __init__(self, served, folder, more=""):
        """more: of the line `listen`, and lines after it."""
        self.host = "127.0.0.1"
        self.log_file = tempfile.TemporaryFile()
        for _ in range(20): # another program may take the port before nginx does
            self.port = free_port()
            with open(folder + "/nginx.conf", "w") as file:
                file.write(CONFIGURATION.format(folder=folder, port=self.port, root=served, more=more))
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


def certificate_of_127_0_0_1(folder):
    """Signed by itself: (certificate, key), files of PEM."""
    pair = folder + "/certificate.pem", folder + "/key.pem"
    subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=127.0.0.1", "-addext",
                    "subjectAltName=IP:127.0.0.1", "-out", pair[0], "-keyout", pair[1]], check=True, stderr=subprocess.DEVNULL)
    return pair


def stroll(*words, **variables):
    environment = {name: value for name, value in os.environ.items() if name not in ("CURL_CA_BUNDLE", "SSL_CERT_FILE")}
    return subprocess.run([STROLL, *words], capture_output=True, text=True, timeout=PATIENCE_S,
                          env={**environment, "no_proxy": "127.0.0.1", **variables})


def must(*words, **variables):
    result = stroll(*words, **variables)
    check(result.returncode == 0, words, result.stderr)
    return result.stdout


def images(model, out, **variables):
    must("render", model, "--path", "orbit", "--frames", "2", "--size", "480x270", "-o", out, "--quiet",
         *(("--no-cache",) if "://" in model else ()), **variables)
    return [content(f"{out}/{name}") for name in sorted(os.listdir(out)) if name.endswith(".png")]


def asked_of(folder):
    """(protocol, connection, begin, end) of each request."""
    lines = [line.split() for line in content(folder + "/asked.log").decode().splitlines()]
    return [(line[0], line[1], float(line[2]) - float(line[3]), float(line[2])) for line in lines]


def most_at_once(asked):
    moments = sorted([(begin, 1) for _, _, begin, _ in asked] + [(end, -1) for _, _, _, end in asked])
    most = now = 0
    for _, step in moments:
        now += step
        most = max(most, now)
    return most


def walks_over_tls_are_those_of_the_file(folder):
    if not shutil.which("openssl"):
        print("not looked at: TLS (there is no openssl)")
        return
    served = make_folder(folder)
    must("scene", "isosurface", "--triangles", "400K", "-o", folder + "/scene.ply")
    must("build", folder + "/scene.ply", "-o", served + "/scene.stroll", "--quiet")
    certificate, key = certificate_of_127_0_0_1(folder)
    local = images(served + "/scene.stroll", folder + "/local"), must("info", served + "/scene.stroll", "--json")
    for http2, variable in (("", "SSL_CERT_FILE"), (" http2", "CURL_CA_BUNDLE")):
        place = folder + "/nginx-tls" + http2.strip()
        os.mkdir(place)
        open_to_all(folder)
        tls = f" ssl{http2}; ssl_certificate {certificate}; ssl_certificate_key {key}; limit_rate 400k"
        with Nginx(served, place, tls) as server:
            url = f"https://127.0.0.1:{server.port}/scene.stroll"
            refused = stroll("info", url, "--no-cache")
            check(refused.returncode == 1 and "the server does not prove who it is" in refused.stderr and
                  refused.stderr.count("\n") == 1 and not asked_of(place), refused.stderr)
            refused = stroll("info", url, "--no-cache", **{variable: folder + "/none.pem"})
            check(refused.returncode == 1 and "none.pem" in refused.stderr and not asked_of(place), refused.stderr)
            trust = {variable: certificate}
            check(must("info", url, "--json", "--no-cache", **trust) == local[1])
            opened = {connection for _, connection, _, _ in asked_of(place)}
            check(images(url, place + "/images", **trust) == local[0])
            server.child.terminate()
            server.child.wait(PATIENCE_S)
        asked = [answer for answer in asked_of(place) if answer[1] not in opened]  # some of before are told late
        connections = {connection for _, connection, _, _ in asked}
        check({protocol for protocol, *_ in asked} == {"HTTP/2.0" if http2 else "HTTP/1.1"}, asked)
        check(most_at_once(asked) > 1 and (len(connections) == 1 if http2 else len(connections) > 1), asked)


if not NGINX:
    print("nginx is not installed")
    sys.exit(77)
sys.exit(run_all("stroll-serve-", (a_part_is_the_same_from_nginx, walks_over_tls_are_those_of_the_file)))
