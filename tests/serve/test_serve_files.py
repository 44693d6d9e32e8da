#!/usr/bin/env python3
"""stroll serve gives files whole and in parts, says what they are, lists them, and never mixes two files in one answer.

usage: test_serve_files.py PROGRAM"""
import email.utils
import html.parser
import json
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import threading
import urllib.parse

from serving import (PATIENCE_S, SECRET, STROLL, Container, Server, age, check, content, head, make_folder, put, read_answer,
                     receive, run_all, sanitized, until)


# ---- parts and conditions
def a_file_is_given_whole_and_in_parts(folder):
    served = make_folder(folder)
    data = content(served + "/model.stroll")
    size = len(data)
    with Server(served) as server:
        whole = server.get("/model.stroll")
        check(whole.status == 200 and whole.body == data and whole["Accept-Ranges"] == "bytes", whole)
        for value, first, last in (("0-0", 0, 0), ("0-99", 0, 99), ("100-", 100, size - 1), ("-7", size - 7, size - 1),
                                   (f"{size - 1}-", size - 1, size - 1), (f"0-{size + 5}", 0, size - 1),
                                   (f"-{size + 5}", 0, size - 1), ("4096-70000", 4096, min(70000, size - 1)),
                                   ("5-99999999999999999999999", 5, size - 1)):
            part = server.get("/model.stroll", Range="bytes=" + value)
            check(part.status == 206 and part.body == data[first:last + 1], value, part)
            check(part["Content-Range"] == f"bytes {first}-{last}/{size}", value, part)
            check(part["ETag"] == whole["ETag"], part)
        for value in (f"{size}-", f"{size}-{size + 9}", "-0", "5-4", "x", "99999999999999999999999-", "1-2x", "", "-"):
            none = server.get("/model.stroll", Range="bytes=" + value)
            check(none.status == 416 and none["Content-Range"] == f"bytes */{size}", value, none)
        for value in ("bytes=0-1,5-6", "items=0-5", "bytes 0-5"):
            check(server.get("/model.stroll", Range=value).body == data, value)


def a_head_is_that_of_the_whole(folder):
    served = make_folder(folder)
    with Server(served) as server:
        for headers in ({}, {"Range": "bytes=0-9"}):
            asked = server.get("/model.stroll", "HEAD", **headers)
            check(asked.status == 200 and asked.body == b"" and asked.rest == b"", asked)
            check(int(asked["Content-Length"]) == os.path.getsize(served + "/model.stroll"), asked)
            check("Content-Range" not in asked.headers, asked)


def a_tag_is_the_model_and_a_date_the_file(folder):
    served = make_folder(folder)
    put(served + "/plain.stroll", b"no container")
    age(served + "/plain.stroll")
    model = Container(content(served + "/model.stroll"))
    with Server(served) as server:
        answer = server.get("/model.stroll", "HEAD")
        check(answer["ETag"] == f'"m-{model.model_id.hex()}"', answer)
        check(email.utils.parsedate_to_datetime(answer["Last-Modified"]).timestamp() ==
              int(os.stat(served + "/model.stroll").st_mtime), answer)
        plain = server.get("/plain.stroll", "HEAD")["ETag"]
        check(plain.startswith('"f-'), plain)
        put(served + "/plain.stroll", b"no contain3r")
        check(server.get("/plain.stroll", "HEAD")["ETag"] != plain)


def conditions_hold(folder):
    served = make_folder(folder)
    then = int(os.stat(served + "/model.stroll").st_mtime)
    date = {shift: email.utils.formatdate(then + shift, usegmt=True) for shift in (-1, 0, 1)}
    with Server(served) as server:
        tag = server.get("/model.stroll", "HEAD")["ETag"]
        cases = (
            ({"If_None_Match": tag}, 304), ({"If_None_Match": "W/" + tag}, 304), ({"If_None_Match": "*"}, 304),
            ({"If_None_Match": '"x", ' + tag}, 304), ({"If_None_Match": '"x"'}, 200),
            ({"If_Match": tag}, 200), ({"If_Match": "*"}, 200), ({"If_Match": '"x"'}, 412), ({"If_Match": "W/" + tag}, 412),
            ({"If_Modified_Since": date[0]}, 304), ({"If_Modified_Since": date[1]}, 304),
            ({"If_Modified_Since": date[-1]}, 200), ({"If_Modified_Since": "yesterday"}, 200),
            ({"If_Unmodified_Since": date[0]}, 200), ({"If_Unmodified_Since": date[-1]}, 412),
            ({"If_None_Match": '"x"', "If_Modified_Since": date[1]}, 200),
            ({"If_Match": tag, "If_Unmodified_Since": date[-1]}, 200),
            ({"Range": "bytes=0-9", "If_Range": tag}, 206), ({"Range": "bytes=0-9", "If_Range": '"x"'}, 200),
            ({"Range": "bytes=0-9", "If_Range": "W/" + tag}, 200), ({"Range": "bytes=0-9", "If_Range": date[0]}, 206),
            ({"Range": "bytes=0-9", "If_Range": date[1]}, 200), ({"Range": "bytes=0-9", "If_Match": '"x"'}, 412),
            ({"Range": "bytes=0-9", "If_None_Match": tag}, 304), ({"Range": "bytes=99999999-", "If_Range": '"x"'}, 200),
        )
        for headers, status in cases:
            for method in ("GET", "HEAD"):
                expected = 200 if method == "HEAD" and status == 206 else status
                answer = server.get("/model.stroll", method, **headers)
                check(answer.status == expected, headers, method, expected, answer)
                check(status != 304 or answer["ETag"] == tag, answer)
        twice = server.ask(b"GET /model.stroll HTTP/1.1\r\nHost: x\r\nConnection: close\r\nIf-None-Match: \"x\"\r\n"
                           b"If-None-Match: " + tag.encode() + b"\r\n\r\n")
        check(twice.status == 304, twice)


def an_empty_file_has_no_part(folder):
    served = make_folder(folder)
    put(served + "/empty.stroll", b"")
    with Server(served) as server:
        answer = server.get("/empty.stroll")
        check(answer.status == 200 and answer["Content-Length"] == "0", answer)
        for value in ("bytes=0-", "bytes=-5", "bytes=0-0"):
            answer = server.get("/empty.stroll", Range=value)
            check(answer.status == 416 and answer["Content-Range"] == "bytes */0", answer)


def a_file_beyond_four_gigabytes_is_given_at_its_end(folder):
    served = make_folder(folder)
    size = (5 << 30) + 7
    with open(served + "/huge.stroll", "wb") as file: # a hole
        file.truncate(size)
        file.seek(size - 5)
        file.write(b"end!\n")
    with Server(served) as server:
        answer = server.get("/huge.stroll", Range="bytes=-5")
        check(answer.body == b"end!\n" and answer["Content-Range"] == f"bytes {size - 5}-{size - 1}/{size}", answer)
        check(int(server.get("/huge.stroll", "HEAD")["Content-Length"]) == size)


# ---- pages of browsers
def a_page_of_another_site_may_read(folder):
    served = make_folder(folder)
    with Server(served) as server:
        answer = server.get("/model.stroll", Range="bytes=0-9", Origin="https://example.org")
        check(answer["Access-Control-Allow-Origin"] == "*", answer)
        for name in ("Content-Range", "ETag", "Accept-Ranges", "Content-Length"):
            check(name in answer["Access-Control-Expose-Headers"], answer)
        asked = server.get("/model.stroll", "OPTIONS", Origin="https://example.org", Access_Control_Request_Method="GET",
                           Access_Control_Request_Headers="range,if-range")
        check(asked.status == 204 and "Range" in asked["Access-Control-Allow-Headers"], asked)
        check("GET" in asked["Access-Control-Allow-Methods"] and "GET" in asked["Allow"], asked)
        check(server.get("*", "OPTIONS").status == 204)
        check(server.get("/no.stroll")["Access-Control-Allow-Origin"] == "*") # the page shall see what is wrong
    with Server(served, "--origin", "https://example.org") as server:
        check(server.get("/model.stroll", "HEAD")["Access-Control-Allow-Origin"] == "https://example.org")
    with Server(served, "--origin", "") as server:
        check("Access-Control-Allow-Origin" not in server.get("/model.stroll", "HEAD").headers)


# ---- listings
NAMES = ("a b.stroll", "<script>alert(1)<.stroll", "quote\"'.stroll", "per%63ent.stroll", "ümläut.stroll", "q?x=1#y.stroll",
         "javascript:alert(1).stroll", "&amp;.stroll", "+.stroll")
HIDDEN = (".hidden.stroll", "note.txt", "model.stroll.tmp", "STROLL", ".stroll", "new\nline.stroll", "back\\slash.stroll")


class Links(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.links, self.tags = [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.links += [value for name, value in attributes if name == "href"]


def make_listed(folder):
    served = make_folder(folder)
    for name in NAMES + HIDDEN:
        put(f"{served}/{name}", name.encode())
    put(os.fsencode(served) + b"/\xff\xfe.stroll", b"not UTF-8")
    os.mkdir(served + "/.git")
    os.mkdir(served + "/x<y>")
    os.mkdir(served + "/folder.stroll")
    os.symlink("../secret.stroll", served + "/leak.stroll")
    os.symlink("..", served + "/door")
    os.symlink("nowhere", served + "/broken.stroll")
    os.mkfifo(served + "/pipe.stroll")
    return served


def a_listing_leads_to_each_file(folder):
    served = make_listed(folder)
    with Server(served) as server:
        answer = server.get("/")
        check(answer.status == 200 and answer["Content-Type"] == "text/html; charset=utf-8", answer)
        check("default-src 'none'" in answer["Content-Security-Policy"], answer)
        page = Links(answer.body.decode())
        check("script" not in page.tags and b"<script>alert" not in answer.body, answer.body)
        found = {urllib.parse.unquote(urllib.parse.urljoin("/", link)) for link in page.links}
        expected = {"/" + name for name in NAMES} | {"/model.stroll", "/sub/", "/x<y>/", "/folder.stroll/"}
        check(found == expected, found ^ expected)
        for link in page.links:
            check(link.startswith("./"), link)
            check(server.get("/" + link[2:]).status == 200, link)
        for name in NAMES:
            check(server.get("/" + urllib.parse.quote(name)).body == name.encode(), name)
        check("../" in Links(server.get("/sub/").body.decode()).links)


def a_listing_is_json_for_programs(folder):
    served = make_listed(folder)
    model = Container(content(served + "/model.stroll"))
    with Server(served) as server:
        for answer in (server.get("/?format=json"), server.get("/", Accept="application/json")):
            check(answer["Content-Type"] == "application/json", answer)
            listing = json.loads(answer.body)
            check({folder["name"] for folder in listing["folders"]} == {"sub", "x<y>", "folder.stroll"}, listing)
            files = {file["name"]: file for file in listing["files"]}
            check(set(files) == set(NAMES) | {"model.stroll"}, set(files))
            check(listing["folder"] == "" and listing["truncated"] is False, listing)
            one = files["model.stroll"]
            check(one["bytes"] == len(model.data) and one["model_id"] == model.model_id.hex(), one)
            check(one["triangles"] == sum(tree.triangles for tree in model.trees) and one["trees"] == len(model.trees), one)
            check(one["etag"] == server.get("/model.stroll", "HEAD")["ETag"], one)
            check(files["+.stroll"]["triangles"] is None and files["+.stroll"]["model_id"] is None, files["+.stroll"])
        check(json.loads(server.get("/sub/?format=json").body)["folder"] == "sub")
        check(server.get("/?format=html", Accept="application/json")["Content-Type"].startswith("text/html"))
        moved = server.get("/sub")
        check(moved.status == 301 and moved["Location"] == "/sub/", moved)
        check(server.get("/x%3cy%3E")["Location"] == "/x%3cy%3e/")


def a_large_folder_is_listed_in_part_and_says_so(folder):
    os.mkdir(folder + "/many")
    for i in range(2100):
        put(f"{folder}/many/{i:05}.stroll", b"")
    with Server(folder + "/many") as server:
        listing = json.loads(server.get("/?format=json").body)
        check(listing["truncated"] is True and len(listing["files"]) == 2000, len(listing["files"]))


def nothing_else_is_served(folder):
    served = make_listed(folder)
    with Server(served) as server:
        for name in HIDDEN[:5] + ("leak.stroll", "door/secret.stroll", "door", "door/", "broken.stroll", "pipe.stroll",
                                  "folder.stroll", "sub/none.stroll", "none/", ".git/", "model.stroll/", "note.txt/"):
            answer = server.get("/" + urllib.parse.quote(name))
            check(answer.status == 404 and SECRET not in answer.body, name, answer)


def a_link_within_the_folder_is_followed_where_the_kernel_watches(folder):
    served = make_folder(folder)
    os.symlink("../model.stroll", served + "/sub/link.stroll")
    with Server(served) as server:
        answer = server.get("/sub/link.stroll")
        check(answer.status in (200, 404), answer) # 404 before Linux 5.6
        check(answer.status == 404 or answer.body == content(served + "/model.stroll"))


# ---- files that change
def halves(server, target):
    """Two requests, the second bound to the first by If-Range; None where the file was another meanwhile."""
    first = server.get(target, Range="bytes=0-999")
    second = server.get(target, Range="bytes=1000-", If_Range=first["ETag"])
    check(first.status == 206 and second.status in (200, 206), first, second)
    return first.body + second.body if second.status == 206 else None


def a_swap_under_way_never_mixes_two_files(folder):
    served = make_folder(folder)
    kinds = [bytes([65 + i]) * (3 << 20) for i in range(2)]
    for i, data in enumerate(kinds):
        put(f"{folder}/{i}", data)
    shutil.copy(folder + "/0", served + "/swapped.stroll")
    done, wrong, seen = threading.Event(), [], set()

    def swap():
        turn = 0
        while not done.is_set():
            turn ^= 1
            shutil.copy(f"{folder}/{turn}", f"{folder}/next")
            os.replace(f"{folder}/next", served + "/swapped.stroll")

    def read(server):
        for i in range(15):
            data = server.get("/swapped.stroll").body if i % 2 else halves(server, "/swapped.stroll")
            if data is not None:
                seen.add(data[:1])
            if data is not None and data not in kinds:
                wrong.append(sorted({(byte, data.count(byte)) for byte in set(data)}))

    with Server(served) as server:
        threads = [threading.Thread(target=read, args=(server,)) for _ in range(6)]
        swapper = threading.Thread(target=swap)
        swapper.start()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        done.set()
        swapper.join()
    check(not wrong and seen, wrong[:3])


def what_is_changed_in_place_is_cut_off(folder):
    served = make_folder(folder)
    size = 64 << 20
    for change in ("truncate", "write"):
        with open(served + "/big.stroll", "wb") as file:
            file.truncate(size)
        age(served + "/big.stroll")
        with Server(served) as server, socket.socket() as connection:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096) # most of it is still to be read
            connection.settimeout(PATIENCE_S)
            connection.connect(("127.0.0.1", server.port))
            connection.sendall(head("GET", "/big.stroll"))
            start = connection.recv(100)
            check(start.startswith(b"HTTP/1.1 200"), start)
            with open(served + "/big.stroll", "r+b") as file:
                file.truncate(1000) if change == "truncate" else file.write(b"other")
            answer = read_answer(connection, rest=start)
            check(not answer.whole and len(answer.body) < size, change, len(answer.body))
            check(answer.body == bytes(len(answer.body)), change) # of the file as it was, what there is
            server.wait_for("aborted_total", 1)
            check("big.stroll" in server.stop(), change)


# ---- many at once, and the end
def two_hundred_clients_read_the_same_bytes(folder):
    served = make_folder(folder)
    data = put(served + "/noise.stroll", random.Random(5).randbytes(1 << 20))
    wrong, gate = [], threading.Barrier(200)

    def read(server, seed):
        choice = random.Random(seed)
        try:
            with server.connect() as connection:
                gate.wait(PATIENCE_S)
                for _ in range(5):
                    first = choice.randrange(len(data))
                    last = min(len(data) - 1, first + choice.randrange(200000))
                    connection.sendall(head("GET", "/noise.stroll", close=False, Range=f"bytes={first}-{last}"))
                    answer = read_answer(connection)
                    check(answer.status == 206 and answer.body == data[first:last + 1], answer)
        except Exception as error: # told by the main thread
            wrong.append(repr(error)[:300])

    with Server(served) as server:
        threads = [threading.Thread(target=read, args=(server, seed)) for seed in range(200)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        check(not wrong, len(wrong), wrong[:3])
        server.wait_for('requests_total{code="206"}', 1000)
        server.wait_for("connections_total", 200)


def a_signal_ends_it_clean(folder):
    served = make_folder(folder)
    with open(served + "/big.stroll", "wb") as file:
        file.truncate(1 << 30)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        for options in ((), ("--bandwidth", "64K")): # sending, and waiting for bandwidth
            with Server(served, *options) as server, server.connect() as idle, server.connect() as busy:
                idle.sendall(head("GET", "/model.stroll", close=False, Range="bytes=0-9"))
                check(read_answer(idle).status == 206)
                busy.sendall(head("GET", "/big.stroll"))
                check(receive(busy).startswith(b"HTTP/1.1 200"))
                server.stop(number)
                while receive(busy):
                    pass
                check(receive(idle) == b"")


def what_cannot_be_served_is_one_sentence(folder):
    served = make_folder(folder)

    def refused(*words, status=1, **more):
        done = subprocess.run([STROLL, "serve", *words], capture_output=True, text=True, timeout=PATIENCE_S, **more)
        check(done.returncode == status and done.stdout == "" and done.stderr.count("\n") == 1, done)
        return done.stderr

    check("none" in refused(folder + "/none"))
    check("model.stroll" in refused(served + "/model.stroll"))
    with Server(served) as server:
        check(f"127.0.0.1:{server.port}" in refused(served, "--port", str(server.port)))
    check("no.such.host.invalid" in refused(served, "--port", "0", "--host", "no.such.host.invalid"))
    check("none/log" in refused(served, "--port", "0", "--access-log", folder + "/none/log"))
    refused(served, "--port", "70000", status=2)
    refused(status=2)
    if not sanitized.sanitizers(STROLL): # which take files of their own
        check("ulimit -n" in refused(served, "--port", "0", preexec_fn=few_files))


def few_files():
    import resource
    resource.setrlimit(resource.RLIMIT_NOFILE, (100, 100))


def other_addresses_are_told_to_be_open(folder):
    served = make_folder(folder)
    with Server(served, host="0.0.0.0") as server:
        server.host = "127.0.0.1"
        check(server.get("/model.stroll", "HEAD").status == 200)
        until(lambda: "warning" in server.log())
    try:
        with socket.socket(socket.AF_INET6) as probe:
            probe.bind(("::1", 0))
    except OSError:
        print("no IPv6 here: not tested")
        return
    with Server(served, host="::1") as server:
        check(server.get("/model.stroll", "HEAD").status == 200)
        log = server.stop()
        check(" [::1]:" in log and "warning" not in log, log)


TESTS = (a_file_is_given_whole_and_in_parts, a_head_is_that_of_the_whole, a_tag_is_the_model_and_a_date_the_file, conditions_hold,
         an_empty_file_has_no_part, a_file_beyond_four_gigabytes_is_given_at_its_end, a_page_of_another_site_may_read,
         a_listing_leads_to_each_file, a_listing_is_json_for_programs, a_large_folder_is_listed_in_part_and_says_so,
         nothing_else_is_served, a_link_within_the_folder_is_followed_where_the_kernel_watches,
         a_swap_under_way_never_mixes_two_files, what_is_changed_in_place_is_cut_off, two_hundred_clients_read_the_same_bytes,
         a_signal_ends_it_clean, what_cannot_be_served_is_one_sentence, other_addresses_are_told_to_be_open)

sys.exit(run_all("stroll-serve-", TESTS))
