#!/usr/bin/env python3
"""The server's limits hold, say so, and leave room for others; what it counts and logs is what happened. No test measures how fast
something is: clocks only bound from below what a limit makes slow, and bound waiting.

usage: test_serve_limits.py PROGRAM"""
import os
import re
import socket
import stat
import sys
import threading
import time

from serving import PATIENCE_S, Server, check, content, head, is_ended, make_folder, put, read_answer, run_all, until


def keep(server, source=None):
    """A connection that stays, with one request answered."""
    connection = server.connect(source)
    connection.sendall(head("GET", "/model.stroll", close=False, Range="bytes=0-5"))
    return connection, read_answer(connection)


# ---- how many
def connections_beyond_the_most_are_told_so(folder):
    served = make_folder(folder)
    with Server(served, "--connections", "3") as server:
        kept = [keep(server) for _ in range(3)]
        check(all(answer.status == 206 for _, answer in kept), kept)
        extra, answer = keep(server)
        check(answer.status == 503 and answer["Retry-After"] == "1" and answer["Connection"] == "close", answer)
        check(is_ended(extra))
        kept[0][0].sendall(head("GET", "/model.stroll", close=False, Range="bytes=0-5"))
        check(read_answer(kept[0][0]).status == 206) # those within go on
        kept[0][0].close()
        until(lambda: keep(server)[1].status == 206, "a place that is free is given away")
        for connection, _ in kept[1:]:
            connection.close()
        server.wait_for('rejected_total{reason="connections"}', 1)


def connections_of_one_address_leave_room_for_others(folder):
    served = make_folder(folder)
    with Server(served, "--per-address", "2") as server:
        kept = [keep(server) for _ in range(2)]
        extra, answer = keep(server)
        check(answer.status == 429 and answer["Retry-After"] == "1" and is_ended(extra), answer)
        other, answer = keep(server, "127.0.0.2")
        check(answer.status == 206, answer)
        for connection, _ in kept:
            connection.close()
        other.close()
        until(lambda: server.get("/metrics").status == 200)
        server.wait_for('rejected_total{reason="address"}', 1)


def requests_of_one_address_have_a_rate(folder):
    served = make_folder(folder)
    with Server(served, "--rate", "0.001") as server: # one, and the next after a thousand seconds
        with server.connect() as connection:
            connection.sendall(head("GET", "/model.stroll", close=False) + head("GET", "/model.stroll", close=False))
            first = read_answer(connection)
            second = read_answer(connection, rest=first.rest)
        check(first.status == 200, first)
        check(second.status == 429 and 0 < int(second["Retry-After"]) <= 1000 and len(second.body) > 10, second)
        check(server.get("/model.stroll").status == 429)
        check(server.get("/model.stroll", source="127.0.0.2").status == 200)
        log = server.stop()
        check(len(re.findall(r" 429 ", log)) == 2, log)


def a_request_has_a_size(folder):
    served = make_folder(folder)
    with Server(served, "--request-bytes", "4K") as server:
        check(server.get("/model.stroll", X="a" * 200).status == 200)
        with server.connect() as connection:
            connection.sendall(head("GET", "/model.stroll", X="a" * 8000))
            answer = read_answer(connection)
            check(answer is None or answer.status == 431, answer)
    with Server(served, "--request-bytes", "1M") as server:
        check(server.get("/model.stroll", X="a" * 100000).status == 200)


# ---- how long
def a_request_that_dribbles_in_is_ended(folder):
    """Byte by byte, so that there is always something new, and never a request."""
    served = make_folder(folder)
    with Server(served, "--timeout", "0.5") as server:
        for start in (b"", b"GET /model.stroll HTTP/1.1\r\nHost: x\r\n"):
            with server.connect() as connection:
                start_s, end_s = time.monotonic(), time.monotonic() + PATIENCE_S
                connection.sendall(start)
                ended = False
                while not ended:
                    check(time.monotonic() < end_s, "it goes on")
                    try:
                        connection.sendall(b"X")
                        connection.settimeout(0.05)
                        ended = connection.recv(100) == b""
                    except TimeoutError:
                        pass
                    except ConnectionError:
                        ended = True
                check(time.monotonic() - start_s > 0.4)
        with server.connect() as silent:
            check(is_ended(silent))
        with server.connect() as kept:
            kept.sendall(head("GET", "/model.stroll", close=False, Range="bytes=0-5"))
            check(read_answer(kept).status == 206 and is_ended(kept))
        server.wait_for('rejected_total{reason="timeout"}', 3)
        server.wait_for('rejected_total{reason="idle"}', 1)
        check(server.metrics()['rejected_total{reason="timeout"}'] == 3, server.metrics())


def a_reader_that_does_not_read_is_ended(folder):
    served = make_folder(folder)
    size = 256 << 20
    with open(served + "/big.stroll", "wb") as file:
        file.truncate(size)
    with Server(served, "--timeout", "0.5") as server, socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.settimeout(PATIENCE_S)
        connection.connect(("127.0.0.1", server.port))
        connection.sendall(head("GET", "/big.stroll"))
        server.wait_for('rejected_total{reason="timeout"}', 1)
        answer = read_answer(connection)
        check(not answer.whole and len(answer.body) < size, len(answer.body))
        server.wait_for("aborted_total", 1)


def slow_clients_do_not_keep_others_out(folder):
    served = make_folder(folder)
    with Server(served, "--connections", "20", "--timeout", "1") as server:
        slow = [server.connect() for _ in range(20)]
        for connection in slow:
            connection.sendall(b"GET / HTTP/1.1\r\nX: ")
        until(lambda: server.get("/model.stroll").status == 200, "the slow keep their places")
        for connection in slow:
            connection.close()


def an_answer_that_takes_long_is_not_ended(folder):
    """Each chunk is progress, however long all of it takes."""
    served = make_folder(folder)
    data = put(served + "/slow.stroll", os.urandom(600000))
    with Server(served, "--timeout", "1.5", "--bandwidth", "200K") as server:
        check(server.get("/slow.stroll").body == data)


def a_bandwidth_is_kept_by_all_together(folder):
    served = make_folder(folder)
    data = put(served + "/slow.stroll", os.urandom(200000))
    with Server(served, "--bandwidth", "200K") as server:
        bodies, start_s = [], time.monotonic()
        threads = [threading.Thread(target=lambda: bodies.append(server.get("/slow.stroll").body)) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        took_s = time.monotonic() - start_s
        check(bodies == [data] * 4)
        check(took_s > 0.9 * (800000 / 204800 - 0.3), took_s) # a quarter of a second's worth was saved up
        check(server.get("/metrics").status == 200)


# ---- what is told
def metrics_are_what_happened(folder):
    served = make_folder(folder)
    size = os.path.getsize(served + "/model.stroll")
    with Server(served) as server:
        for _ in range(3):
            server.get("/model.stroll")
        server.get("/model.stroll", Range="bytes=0-99")
        server.get("/none.stroll")
        server.get("/model.stroll", "HEAD")
        for status, least in (("200", 4), ("206", 1), ("404", 1)):
            server.wait_for(f'requests_total{{code="{status}"}}', least)
        text, metrics = server.get("/metrics").body.decode(), server.metrics()
        check(metrics['requests_total{code="206"}'] == metrics['requests_total{code="404"}'] == 1, metrics)
        check(metrics["bytes_total"] >= 3 * size + 100, metrics)
        check(metrics["connections_total"] == server.connected and metrics["connections"] >= 1, metrics)
        check(metrics['request_seconds_bucket{le="+Inf"}'] == metrics["request_seconds_count"] >= 6, metrics)
        buckets = [value for name, value in metrics.items() if name.startswith("request_seconds_bucket")]
        check(buckets == sorted(buckets), metrics)
        for line in text.splitlines(): # the format of Prometheus
            check(re.fullmatch(r"# (HELP|TYPE) stroll_serve_\w+ .+|stroll_serve_\w+(\{\w+=\"[^\"]*\"\})? [0-9.e+-]+", line), line)


LINE = re.compile(r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z) (127\.0\.0\.1:\d+) (\S+) (\S+) (\d+) (\d+) (\d+\.\d{3})")


def each_request_is_a_line_of_the_log(folder):
    served = make_folder(folder)
    size = os.path.getsize(served + "/model.stroll")
    put(folder + "/log", b"a line before\n")
    with Server(served, "--access-log", folder + "/log") as server:
        server.get("/model.stroll")
        server.get("/model.stroll?nodes=0:0", "HEAD")
        server.get("/a%0ab%20.stroll")
        server.get("/" + "x" * 3000)
        check(server.stop() == "") # nothing on standard error
    lines = content(folder + "/log").decode().splitlines()
    check(lines[0] == "a line before" and len(lines) == 5, lines)
    parts = [LINE.fullmatch(line) for line in lines[1:]]
    check(all(parts), lines)
    told = sorted(part.groups()[2:6] for part in parts) # which thread is the first to write is its own business
    check(told[0][1:3] == ("/a%0ab%20.stroll", "400"), told)
    check(told[1] == ("GET", "/model.stroll", "200", str(size)), told)
    check(told[2][2] == "414" and len(told[2][1]) < 1100, told)
    check(told[3] == ("HEAD", "/model.stroll?nodes=0:0", "200", "0"), told)
    check(stat.S_ISREG(os.stat(folder + "/log").st_mode))


def a_log_that_cannot_be_written_is_told_once(folder):
    served = make_folder(folder)
    with Server(served, "--access-log", "/dev/full") as server:
        for _ in range(3):
            check(server.get("/model.stroll").status == 200)
        log = server.stop()
        check(log.count("lines of the access log are lost") == 1, log)


def a_log_that_nobody_reads_ends_nothing(folder):
    served = make_folder(folder)
    pipe = folder + "/pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    with Server(served, "--access-log", pipe) as server:
        check(server.get("/model.stroll").status == 200)
        os.close(reader)
        for _ in range(3):
            check(server.get("/model.stroll").status == 200)
        check("lines of the access log are lost" in server.stop())


TESTS = (connections_beyond_the_most_are_told_so, connections_of_one_address_leave_room_for_others,
         requests_of_one_address_have_a_rate, a_request_has_a_size, a_request_that_dribbles_in_is_ended,
         a_reader_that_does_not_read_is_ended, slow_clients_do_not_keep_others_out, an_answer_that_takes_long_is_not_ended,
         a_bandwidth_is_kept_by_all_together, metrics_are_what_happened, each_request_is_a_line_of_the_log,
         a_log_that_cannot_be_written_is_told_once, a_log_that_nobody_reads_ends_nothing)

sys.exit(run_all("stroll-serve-", TESTS))
