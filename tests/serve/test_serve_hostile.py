#!/usr/bin/env python3
"""Requests that no client of good faith sends: each gets the right refusal or none at all, none gets a byte from outside of the
folder, and the server goes on.

usage: test_serve_hostile.py PROGRAM"""
import os
import random
import re
import socket
import struct
import sys

from serving import SECRET, Server, check, content, head, make_folder, put, read_answer, receive, run_all

ENDED = 0 # the connection is ended without an answer
PATIENT = ("--timeout", "4") # libmicrohttpd sees no end of a connection right behind half a head, so only time ends it
REFUSED = (400, 404, 414, 405, 413, 431, ENDED)


def get(target, *lines, version="HTTP/1.1", method="GET", close=True):
    lines = ("Host: x",) + (("Connection: close",) if close else ()) + lines
    return b"\r\n".join([b" ".join((method.encode(), target if isinstance(target, bytes) else target.encode("latin-1"),
                                    version.encode()))] + [line.encode("latin-1") for line in lines]) + b"\r\n\r\n"


# ---- what it asks for: the request, and the statuses that are right
PATHS = [
    ("/../secret.txt", 400), ("/../../../../etc/passwd", 400), ("/..", 400), ("/../", 400), ("/sub/../../secret.stroll", 400),
    ("/sub/../model.stroll", 400), ("/./model.stroll", 400), ("/%2e%2e/secret.stroll", 400), ("/%2E%2E/secret.stroll", 400),
    ("/.%2e/secret.stroll", 400), ("/%2e./secret.stroll", 400), ("/..%2fsecret.stroll", 400), ("/..%2Fsecret.stroll", 400),
    ("/%2e%2e%2fsecret.stroll", 400), ("/%252e%252e%252fsecret.stroll", 404), ("/..%5csecret.stroll", 400),
    ("/..\\secret.stroll", 400), ("/%5c..%5csecret.stroll", 400), ("/..%c0%afsecret.stroll", 400),
    ("/%c0%ae%c0%ae/secret.stroll", 400), ("/%e0%80%ae%e0%80%ae/secret.stroll", 400), ("/..;/secret.stroll", 404),
    ("/....//secret.stroll", 400), ("//secret.stroll", 400), ("///etc/passwd", 400), ("//etc/passwd", 400),
    ("/model.stroll%00.txt", 400), ("/%00", 400), ("/../secret.txt%00.stroll", 400), ("/model.stroll%0d%0aX:%20y", 400),
    ("/model.stroll%", 400), ("/model.stroll%2", 400), ("/%zz.stroll", 400), ("/%u002e%u002e/secret.stroll", 400),
    ("/%ff%fe.stroll", 400), ("/\xff.stroll", 400), ("/%ed%a0%80.stroll", 400), ("/~root/.ssh/id_rsa", 404),
    ("/proc/self/environ", 404), ("/.git/config", 404), ("/.hidden.stroll", 404), ("/sub/%2ehidden.stroll", 404),
    ("/secret.stroll", 404), ("/leak.stroll", 404), ("/door/secret.stroll", 404), ("/door/", 404), ("/absolute.stroll", 404),
    ("/model.stroll/../../secret.stroll", 400), ("/model.stroll/", 404), ("/model.stroll/x.stroll", 404),
    ("/MODEL.STROLL", 404), ("/model.stroll.", 404), ("/model.stroll%20", 404), ("/model.stroll::$DATA", 404),
    ("/" + "a" * 300 + ".stroll", 414), ("/" + "a/" * 600 + "x.stroll", 414), ("/" + "%61" * 1025 + ".stroll", 414),
    ("file:///etc/passwd", 400), ("http:///etc/passwd", 400), ("http://x/../secret.stroll", 400), ("*", 400), ("x", 400),
    ("/model.stroll#x", 400), ("?", 400), ("/model.stroll?nodes=0:0&x=../../secret", 400), ("/?format=../../secret", 400),
]
LARGE = [
    ("a target of 100 KB", get("/" + "a" * 100000), (414, 431, ENDED)),
    ("a query of 100 KB", get("/model.stroll?nodes=0:" + "1" * 100000), (414, 431, ENDED)),
    ("a head of 100 KB", get("/model.stroll", "X: " + "a" * 100000), (431, 413, ENDED)),
    ("ten thousand lines", get("/model.stroll", *["X: y"] * 10000), (431, 413, ENDED)),
    ("a name of 50 KB", get("/model.stroll", "a" * 50000 + ": y"), (431, 413, ENDED)),
    ("thousands of parameters", get("/model.stroll?" + "&" * 9000), (200, 400, 413, 414, 431, ENDED)),
    ("thousands of other parameters", get("/model.stroll?" + "a&" * 6000), (400, 413, 414, 431, ENDED)),
    ("a number of a thousand digits", get("/model.stroll", "Range: bytes=" + "9" * 1000 + "-"), (416,)),
    ("a thousand ranges", get("/model.stroll", "Range: bytes=" + ",".join(["0-0"] * 1000)), (200,)),
    ("a thousand tags", get("/model.stroll", "If-None-Match: " + ",".join(['"x"'] * 1000)), (200,)),
]
RANGES = [
    ("a range that overflows", get("/model.stroll", "Range: bytes=18446744073709551616-18446744073709551617"), (416,)),
    ("a range at the end of numbers", get("/model.stroll", "Range: bytes=18446744073709551615-"), (416,)),
    ("a range backwards", get("/model.stroll", "Range: bytes=9-0"), (416,)),
    ("a range below zero", get("/model.stroll", "Range: bytes=--5"), (416,)),
    ("a suffix of nothing", get("/model.stroll", "Range: bytes=-0"), (416,)),
    ("a range of letters", get("/model.stroll", "Range: bytes=a-z"), (416,)),
    ("a range with a zero in it", get("/model.stroll", "Range: bytes=0-\x00"), (200, 206, 400, 416, ENDED)),
    ("two lines of ranges", get("/model.stroll", "Range: bytes=0-0", "Range: bytes=1-1"), (400,)),
    ("two lines of If-Range", get("/model.stroll", 'If-Range: "a"', 'If-Range: "b"', "Range: bytes=0-0"), (400,)),
    ("five lines of tags", get("/model.stroll", *['If-Match: "x"'] * 5), (400,)),
    ("a tag without an end", get("/model.stroll", 'If-Match: "x'), (412,)),
    ("a date that overflows", get("/model.stroll", "If-Modified-Since: Sun, 06 Nov 99999999999 08:49:37 GMT"), (200,)),
]
FRAMES = [ # what two readers could take for different numbers of requests
    ("a length and an encoding", get("/model.stroll", "Content-Length: 4", "Transfer-Encoding: chunked") + b"0\r\n\r\n", REFUSED),
    ("two lengths", get("/model.stroll", "Content-Length: 0", "Content-Length: 40") + b"GET /secret HTTP/1.1\r\nHost: x\r\n\r\n", REFUSED),
    ("two equal lengths", get("/model.stroll", "Content-Length: 5", "Content-Length: 5") + b"12345", REFUSED),
    ("a list of lengths", get("/model.stroll", "Content-Length: 5, 5") + b"12345", REFUSED),
    ("a length below zero", get("/model.stroll", "Content-Length: -1"), REFUSED),
    ("a length with a sign", get("/model.stroll", "Content-Length: +5") + b"12345", REFUSED),
    ("a length that overflows", get("/model.stroll", "Content-Length: 99999999999999999999999"), REFUSED),
    ("a length of letters", get("/model.stroll", "Content-Length: 0x5") + b"12345", REFUSED),
    ("a length of 2^63", get("/model.stroll", "Content-Length: 9223372036854775808"), REFUSED),
    ("a chunk of -1", get("/model.stroll", "Transfer-Encoding: chunked") + b"-1\r\n\r\n", REFUSED),
    ("a chunk that overflows", get("/model.stroll", "Transfer-Encoding: chunked") + b"fffffffffffffffff\r\nx", REFUSED),
    ("an unknown encoding", get("/model.stroll", "Transfer-Encoding: xchunked") + b"0\r\n\r\n", REFUSED),
    ("two encodings", get("/model.stroll", "Transfer-Encoding: gzip", "Transfer-Encoding: chunked") + b"0\r\n\r\n", REFUSED),
    ("a blank before the colon", get("/model.stroll", "Content-Length : 5") + b"12345", REFUSED),
    ("a line that goes on", get("/model.stroll", "X: y\r\n Content-Length: 5") + b"12345", (200, 400, ENDED)),
    ("a name that is none", get("/model.stroll", "a(b): c"), REFUSED),
    ("a line without a colon", get("/model.stroll", "nonsense"), REFUSED),
    ("two hosts", get("/model.stroll", "Host: y"), (400,)),
    ("no host", b"GET /model.stroll HTTP/1.1\r\nConnection: close\r\n\r\n", (400,)),
    ("a body of a GET", get("/model.stroll", "Content-Length: 5") + b"12345", REFUSED),
    ("a body that waits to be asked for", get("/model.stroll", "Content-Length: 5", "Expect: 100-continue"), REFUSED),
]
LINES = [
    ("nothing of HTTP", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(200), REFUSED),
    ("noise", random.Random(1).randbytes(5000) + b"\r\n\r\n", REFUSED),
    ("a line alone", b"GET\r\n\r\n", REFUSED),
    ("HTTP/0.9", b"GET /model.stroll\r\n\r\n", REFUSED),
    ("HTTP/2", get("/model.stroll", version="HTTP/2.0"), (400, 505, ENDED)),
    ("the preface of HTTP/2", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", (400, 405, 505, ENDED)),
    ("a version that is none", get("/model.stroll", version="HTTP/1.x"), (400, ENDED)),
    ("a blank in the target", get("/model.stroll /../secret.txt"), REFUSED),
    ("a zero in the target", get(b"/model.stroll\x00/../../secret.txt"), (200, 400, 404, ENDED)),
    ("control characters in the target", get(b"/\x1b[31m\x07.stroll"), (400, ENDED)),
    ("control characters in the method", get("/", method="G\x1bT"), (400, 405, ENDED)),
    ("a method of 10 KB", get("/", method="A" * 10000), (400, 405, 414, 431, ENDED)),
    *((f"the method {method}", get("/model.stroll", method=method), (405,))
      for method in ("POST", "PUT", "DELETE", "PATCH", "TRACE", "CONNECT", "PROPFIND", "get", "FOO")),
    ("a POST with a body", get("/model.stroll", "Content-Length: 3", method="POST") + b"abc", (405, ENDED)),
    ("a PUT of a terabyte", get("/new.stroll", "Content-Length: 1099511627776", method="PUT") + bytes(5000), (405, ENDED)),
    ("an upgrade", get("/model.stroll", "Upgrade: h2c", "HTTP2-Settings: AAMAAABkAARAAAAAAAIAAAAA"), (200,)),
]


def make_hostile(folder):
    served = make_folder(folder)
    os.symlink("../secret.stroll", served + "/leak.stroll")
    os.symlink("..", served + "/door")
    os.symlink("/etc/passwd", served + "/absolute.stroll")
    put(served + "/.hidden.stroll", SECRET)
    put(served + "/sub/.hidden.stroll", SECRET)
    return served


def send(server, data):
    """All that comes back; a server that ends a connection while we still send may reset it."""
    with server.connect() as connection:
        try:
            connection.sendall(data)
            connection.shutdown(socket.SHUT_WR)
        except OSError: # reset, or no longer connected
            pass
        parts = []
        while some := receive(connection):
            parts.append(some)
        return b"".join(parts)


def first_status(data):
    return int(data.split(b" ", 2)[1]) if data.startswith(b"HTTP/1.") else ENDED


def check_alive(server):
    answer = server.get("/model.stroll", Range="bytes=0-5")
    check(answer.status == 206 and answer.body == b"STROLL", answer)


def statuses_of(data):
    return [int(status) for status in re.findall(rb"HTTP/1\.1 (\d{3}) ", data)]


def check_cases(folder, cases):
    with Server(make_hostile(folder), *PATIENT) as server:
        for name, data, statuses in cases:
            answer = send(server, data)
            check(first_status(answer) in statuses, name, statuses, answer[:300])
            check(SECRET not in answer and b"root:" not in answer, name, answer[:300])
            # libmicrohttpd 0.9.75 sends the head of some refusals of its own twice, and then ends the connection.
            check(len(statuses_of(answer)) <= 1 or (b"<html>" in answer and len(set(statuses_of(answer))) == 1), name, answer[:2000])
            check_alive(server)
        return server.stop()


def no_path_leads_out(folder):
    check(len(PATHS) + len(LARGE) + len(RANGES) + len(FRAMES) + len(LINES) > 100)
    check_cases(folder, [(path, get(path), (status,)) for path, status in PATHS])


def large_requests_are_refused(folder):
    check_cases(folder, LARGE)


def wrong_ranges_are_refused(folder):
    check_cases(folder, RANGES)


def requests_are_as_many_as_they_seem(folder):
    check_cases(folder, FRAMES)


def what_is_no_request_is_refused(folder):
    check_cases(folder, LINES)


def the_log_holds_no_control_character(folder):
    log = check_cases(folder, [("target", get(b"/\x1b[31m\xc3\xa4\"\\\x07.stroll"), REFUSED), ("method", get("/", method="G\x1bT"), REFUSED),
                               ("line", get("/", "X\x1b[2J: \x1b[2J"), REFUSED), ("noise", b"\x1b[2J \x1b[2J\r\n\r\n", REFUSED),
                               ("encoded", get("/%0a2026-01-01T00:00:00Z%201.2.3.4%20GET%20/forged%20200%200%200"), REFUSED)])
    check(all(32 <= ord(c) < 127 or c == "\n" for c in log), log)
    check("\\x1b[31m" in log, log)
    for line in log.splitlines():
        check(line[:2] == "20" and line[23:25] == "Z ", line)


def pipelined_requests_are_answered_in_turn(folder):
    served = make_hostile(folder)
    data = content(served + "/model.stroll")
    with Server(served) as server, server.connect() as connection:
        ranges = [(i * 7, i * 7 + i) for i in range(100)]
        connection.sendall(b"".join(head("GET", "/model.stroll", close=False, Range=f"bytes={a}-{b}") for a, b in ranges))
        rest = b""
        for first, last in ranges:
            answer = read_answer(connection, rest=rest)
            check(answer.status == 206 and answer.body == data[first:last + 1], first, answer)
            rest = answer.rest
        # A refusal between others leaves the rest as it is.
        connection.sendall(get("/a/../b", close=False) + get("/model.stroll", "Range: bytes=0-5", close=False))
        refusal = read_answer(connection)
        check(refusal.status == 400, refusal)
        check(read_answer(connection, rest=refusal.rest).body == b"STROLL")


def behind_a_body_nothing_is_taken_for_a_request(folder):
    inner = get("/model.stroll", "Range: bytes=0-5")
    with Server(make_hostile(folder)) as server:
        for outer in (get("/", f"Content-Length: {len(inner)}", close=False), get("/", "Transfer-Encoding: chunked", close=False),
                      get("/", f"Content-Length: {len(inner)}", method="POST", close=False),
                      get("/", "Content-Length: 0", f"Content-Length: {len(inner)}", close=False),
                      get("/", f"Content-Length : {len(inner)}", close=False)):
            answer = send(server, outer + inner)
            check(len(statuses_of(answer)) <= 1 and first_status(answer) in REFUSED, outer, answer)
        check_alive(server)


def half_closed_and_broken_connections_do_no_harm(folder):
    served = make_hostile(folder)
    data = content(served + "/model.stroll")
    with Server(served, *PATIENT) as server:
        answer = send(server, get("/model.stroll")) # half closed behind the request
        check(answer.endswith(data), answer[:300])
        for cut in (0, 10, 40): # in the middle of it
            check(send(server, get("/model.stroll")[:cut]) == b"", cut)
        for _ in range(50): # gone without a word, in the middle of an answer
            with server.connect() as connection:
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                connection.sendall(get("/model.stroll"))
        for _ in range(50): # gone before any word
            server.connect().close()
        check_alive(server)


def random_heads_do_no_harm(folder):
    choice = random.Random(9)
    words = ["GET", "HEAD", "POST", " ", "  ", "\t", "/", "/model.stroll", "..", "%2e", "?nodes=0:0", "&", "=", "HTTP/1.1", "HTTP/1.0",
             "\r\n", "\n", "\r", "Host: x", "Range: bytes=", "0-9", "-", ",", "Content-Length: ", "5", "Transfer-Encoding: chunked",
             "Connection: close", "If-Match: ", "\"", "*", "\0", "\xff", ":", "X", "Expect: 100-continue"]
    with Server(make_hostile(folder), "--timeout", "2") as server:
        for _ in range(200):
            text = "".join(choice.choice(words) for _ in range(choice.randrange(60)))
            start = choice.choice(["", "GET /model.stroll HTTP/1.1\r\nHost: x\r\n", "GET /"])
            answer = send(server, (start + text + "\r\n\r\n").encode("latin-1"))
            check(SECRET not in answer, text)
        check_alive(server)


TESTS = (no_path_leads_out, large_requests_are_refused, wrong_ranges_are_refused, requests_are_as_many_as_they_seem,
         what_is_no_request_is_refused, the_log_holds_no_control_character, pipelined_requests_are_answered_in_turn,
         behind_a_body_nothing_is_taken_for_a_request, half_closed_and_broken_connections_do_no_harm, random_heads_do_no_harm)

sys.exit(run_all("stroll-serve-", TESTS))
