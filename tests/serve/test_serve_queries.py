#!/usr/bin/env python3
"""Queries for nodes are answered with exactly the pieces of the file that these nodes need; what is asked for is worked out here
from docs/format.md and docs/serve.md alone.

usage: test_serve_queries.py PROGRAM"""
import os
import random
import shutil
import subprocess
import sys
import threading

from serving import GOLDEN, STROLL, Container, Message, Server, check, content, head, make_folder, put, run_all

NONE = 0xffffffff


def build_model(folder):
    """A container of several treelets and pages."""
    for words in (["scene", "isosurface", "-n", "450K", "-o", folder + "/model.ply"],
                  ["build", folder + "/model.ply", "-o", folder + "/model.stroll"]):
        done = subprocess.run([STROLL, *words, "--quiet"], stderr=subprocess.PIPE, text=True)
        check(done.returncode == 0, done.stderr)
    return folder + "/model.stroll"


def make_queried(folder, built):
    served = make_folder(folder)
    shutil.copy(built, served + "/model.stroll")
    return served, Container(content(built))


def ask(server, query, name="/model.stroll"):
    answer = server.get(f"{name}?{query}")
    check(answer.status == 200, query, answer)
    return Message(answer.body)


def check_answer(message, model, tree, nodes):
    """Whole: each piece that the nodes need once, in the file's order, with the file's bytes."""
    check(message.model_id == model.model_id and message.tree == tree, message.model_id)
    check(not message.cut and message.next_node == NONE and message.node_count == len(nodes), message.node_count, len(nodes))
    check([(offset, len(data)) for offset, data in message.records] == model.trees[tree].pieces(nodes), sorted(nodes)[:50])
    for offset, data in message.records:
        check(model.data[offset:offset + len(data)] == data, offset)


def listed(nodes):
    return ",".join(map(str, nodes))


def subtrees(items):
    return ",".join(f"{node}/{depth}" for node, depth in items)


def the_test_model_has_what_it_takes(folder, built):
    served, model = make_queried(folder, built)
    check(len(model.trees[0].treelets) >= 2 and len(model.trees[0].nodes) > 200, len(model.trees[0].nodes))
    check(len({node["page"] for node in model.trees[0].nodes.values()}) > 2)


def nodes_bring_their_treelets_and_pages(folder, built):
    served, model = make_queried(folder, built)
    tree, choice = model.trees[0], random.Random(1)
    with Server(served) as server:
        for nodes in [[0], [tree.node_count - 1], [0, tree.node_count - 1], range(tree.node_count),
                      tree.nodes[0]["children"]] + [sorted(choice.sample(range(tree.node_count), k)) for k in range(1, 40, 3)]:
            check_answer(ask(server, "nodes=0:" + listed(nodes)), model, 0, set(nodes))
        check(server.get("/model.stroll?nodes=0:0", "HEAD").status == 200)
        check(server.metrics()["containers"] == 1)


def subtrees_bring_all_down_to_their_depth(folder, built):
    served, model = make_queried(folder, built)
    tree, choice = model.trees[0], random.Random(2)
    with Server(served) as server:
        cases = [[(0, depth)] for depth in (0, 1, 2, 3, 65535)] + [[(tree.node_count - 1, 5)]]
        cases += [[(node, choice.randrange(4)) for node in sorted(choice.sample(range(tree.node_count), 1 + i % 9))]
                  for i in range(40)]
        cases += [[(0, 1), (child, 3)] for child in tree.nodes[0]["children"]] # one within another
        for items in cases:
            nodes = set().union(*(tree.subtree(node, depth) for node, depth in items))
            check_answer(ask(server, "subtrees=0:" + subtrees(items)), model, 0, nodes)
        encoded = ask(server, "subtrees=0%3A0%2F2")
        check_answer(encoded, model, 0, tree.subtree(0, 2))


def asked_in_any_order_answers_are_the_same(folder, built):
    served, model = make_queried(folder, built)
    tree = model.trees[0]
    last = tree.node_count - 1
    with Server(served) as server: # a deep node first, before any treelet is known
        check_answer(ask(server, f"nodes=0:{last}"), model, 0, {last})
        check_answer(ask(server, "subtrees=0:0/9"), model, 0, tree.subtree(0, 9))
    wrong = []

    def many(server, seed):
        choice = random.Random(seed)
        try:
            for _ in range(10):
                nodes = sorted(choice.sample(range(tree.node_count), 20))
                check_answer(ask(server, "nodes=0:" + listed(nodes)), model, 0, set(nodes))
        except Exception as error: # told by the main thread
            wrong.append(repr(error)[:300])

    with Server(served) as server:
        threads = [threading.Thread(target=many, args=(server, seed)) for seed in range(16)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    check(not wrong, wrong[:3])


def what_is_too_much_is_cut_and_says_where(folder, built):
    served, model = make_queried(folder, built)
    tree = model.trees[0]
    everything = tree.subtree(0, 65535)
    with Server(served) as server, Server(served, "--answer-bytes", "256K") as short:
        for one, most in ((server, 300000), (short, None), (short, 1 << 30)):
            limit = min(most or 1 << 30, 262144 if one is short else 1 << 30)
            left, answered = sorted(everything), set()
            while left:
                query = f"nodes=0:{listed(left)}" + (f"&most={most}" if most else "")
                answer = one.get("/model.stroll?" + query)
                message = Message(answer.body)
                check(message.cut == (message.next_node != NONE), message.next_node)
                check(len(answer.body) <= limit or message.node_count == 1, len(answer.body), limit)
                some = [node for node in left if not message.cut or node < message.next_node]
                check(len(some) == message.node_count >= 1, len(some), message.node_count)
                check([(offset, len(data)) for offset, data in message.records] == tree.pieces(some), some)
                answered.update(some)
                left = left[len(some):]
            check(answered == everything)
        message = Message(server.get("/model.stroll?nodes=0:0,1&most=1").body)
        check(message.node_count == 1 and message.next_node == 1 and len(message.records) == 2, message.next_node)
        message = Message(server.get("/model.stroll?subtrees=0:0/65535&most=300000").body)
        some = {node for node in everything if node < message.next_node}
        check(message.cut and len(some) < len(everything) and message.node_count == len(some), message.next_node)
        check(sorted((offset, len(data)) for offset, data in message.records) == tree.pieces(some))
        check(server.metrics()["queries_cut_total"] >= 2)


def a_query_of_much_work_takes_turns(folder, built):
    """Each node with all that is below it: more nodes are looked at than the 1,024 of a turn."""
    served, model = make_queried(folder, built)
    tree = model.trees[0]
    query = "subtrees=0:" + subtrees((node, 65535) for node in range(tree.node_count))
    looked_at = sum(len(tree.subtree(node, 65535)) for node in range(tree.node_count))
    check(looked_at > 1024, looked_at)
    with Server(served) as server:
        check_answer(ask(server, query), model, 0, set(range(tree.node_count)))
        turns = server.metrics()["query_turns_total"]
        check(looked_at // 1024 < turns <= looked_at // 1024 + 10, turns, looked_at)
        for _ in range(40): # who leaves in between gives the place back
            with server.connect() as gone:
                gone.sendall(head("GET", f"/model.stroll?{query}", close=False))
        check_answer(ask(server, query), model, 0, set(range(tree.node_count)))


def what_is_not_there_is_refused(folder, built):
    served, model = make_queried(folder, built)
    count = model.trees[0].node_count
    put(served + "/plain.stroll", b"no container")
    with Server(served) as server:
        for query in (f"nodes=0:{count}", f"nodes=0:0,{count}", f"nodes={len(model.trees)}:0", "nodes=0:4294967294",
                      f"subtrees=0:{count}/1", "nodes=0:2,1", "nodes=0:1,1", "nodes=0:", "nodes=", "nodes=0:-1",
                      "nodes=0:99999999999999999999", "subtrees=0:1", "subtrees=0:1/65536", "most=0", "other=1", "format=json",
                      "nodes=0:" + listed(range(4097)), "nodes=0:1&nodes=0:2"):
            answer = server.get("/model.stroll?" + query)
            check(answer.status == 400 and len(answer.body) > 10, query, answer)
        check(b"less than" in server.get(f"/model.stroll?nodes=0:{count}").body)
        check(server.get("/plain.stroll?nodes=0:0").status == 422)
        check(server.get("/none.stroll?nodes=0:0").status == 404)
        check(server.get("/?nodes=0:0").status == 400)


def a_replaced_container_is_answered_from_anew(folder, built):
    served, model = make_queried(folder, built)
    small = Container(content(served + "/sub/small.stroll"))
    with Server(served) as server:
        check_answer(ask(server, "nodes=0:0"), model, 0, {0})
        shutil.copy(served + "/sub/small.stroll", folder + "/next")
        os.replace(folder + "/next", served + "/model.stroll")
        check_answer(ask(server, "nodes=0:0"), small, 0, {0})


def more_containers_than_are_kept_open_are_answered(folder, built):
    served, model = make_queried(folder, built)
    for i in range(40):
        shutil.copy(served + "/model.stroll", f"{served}/{i}.stroll")
    with Server(served) as server:
        for turn in range(2):
            for i in range(40):
                check_answer(ask(server, "subtrees=0:0/2", f"/{i}.stroll"), model, 0, model.trees[0].subtree(0, 2))
        check(1 <= server.metrics()["containers"] <= 16)


def damaged_containers_are_refused_and_harm_nobody(folder, built):
    served, model = make_queried(folder, built)
    names = sorted(name for name in os.listdir(GOLDEN) if name.endswith(".stroll"))
    check(len(names) > 40)
    for name in names:
        shutil.copy(f"{GOLDEN}/{name}", f"{served}/{name}")
    choice = random.Random(3)
    for i in range(60): # wrong anywhere
        data, places = bytearray(model.data), [(0, 4096), *model.trees[0].treelets.values()]
        for _ in range(1 + i % 5):
            offset, size = choice.choice(places)
            data[offset + choice.randrange(size)] ^= 1 << choice.randrange(8)
        names.append(f"flipped{i}.stroll")
        put(f"{served}/{names[-1]}", data)
    for i in range(20): # an end too early
        names.append(f"cut{i}.stroll")
        put(f"{served}/{names[-1]}", model.data[:choice.randrange(len(model.data))])
    refused = 0
    with Server(served) as server:
        for name in names:
            for query in ("nodes=0:0", "subtrees=0:0/65535"):
                answer = server.get(f"/{name}?{query}")
                check(answer.status in (200, 400, 422, 503), name, answer)
                refused += answer.status != 200
                if answer.status == 200:
                    Message(answer.body)
        check(server.get("/?format=json").status == 200)
        check_answer(ask(server, "nodes=0:0"), model, 0, {0})
    check(refused > 100, refused)


TESTS = (the_test_model_has_what_it_takes, nodes_bring_their_treelets_and_pages, subtrees_bring_all_down_to_their_depth,
         asked_in_any_order_answers_are_the_same, what_is_too_much_is_cut_and_says_where, a_query_of_much_work_takes_turns,
         what_is_not_there_is_refused,
         a_replaced_container_is_answered_from_anew, more_containers_than_are_kept_open_are_answered,
         damaged_containers_are_refused_and_harm_nobody)

sys.exit(run_all("stroll-serve-", TESTS, build_model))
