/* The server as a part of a program: it ends whatever is under way, holds as much memory as it may, and tells its owner
 * what went wrong. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "container/fixture.h"
#include "platform/file.h"
#include "platform/thread.h"
#include "serve/server.h"
#include "support/folder.h"

#define MS ((uint64_t)1000000)
#define PATIENCE_NS (60000 * MS) /* against hanging alone */
#define CLIENTS 12u

static void put_file(const char *name, size_t bytes)
{
    char path[200];
    snprintf(path, sizeof path, "%s/%s", strl_test_path("served"), name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    for (size_t i = 0; i < bytes; i++)
        fputc((int)(i * 7 & 255), file);
    assert_int_equal(fclose(file), 0);
}

static int set_up(void **state)
{
    int failed = strl_test_folder_make(state);
    if (failed)
        return failed;
    assert_int_equal(strl_path_make_directory(strl_test_path("served"), NULL), STRL_OK);
    put_file("big.stroll", 4 << 20);
    return 0;
}

static int tear_down(void **state)
{
    strl_path_remove_directory(strl_test_path("served"), NULL);
    return strl_test_folder_remove(state);
}

static strl_server *must_open(const strl_server_desc *like)
{
    strl_server_desc desc = *like;
    strl_server *server = NULL;
    strl_error err = {0};
    desc.folder = like->folder ? like->folder : strl_test_path("served");
    if (strl_server_open(&desc, &server, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return server;
}

/* -1 where nobody listens. */
static int connect_to(uint16_t port)
{
    const struct sockaddr_in address = {
        .sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    int made = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (made >= 0 && connect(made, (const struct sockaddr *)&address, sizeof address) == 0)
        return made;
    close(made);
    return -1;
}

static int ask(uint16_t port, const char *target)
{
    char request[300];
    int made = connect_to(port);
    assert_true(made >= 0);
    int size = snprintf(request, sizeof request, "GET %s HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n", target);
    assert_int_equal(send(made, request, (size_t)size, MSG_NOSIGNAL), size);
    return made;
}

/* The answer's status; 0 where the connection ended without one. */
static int status_of(int client)
{
    char text[13] = "";
    size_t have = 0;
    for (ssize_t got; have < 12 && (got = recv(client, text + have, 12 - have, 0)) > 0;)
        have += (size_t)got;
    return have == 12 ? atoi(text + 9) : 0;
}

static void wait_for_end(int client)
{
    char some[4096];
    while (recv(client, some, sizeof some, 0) > 0)
        ;
    close(client);
}

static void closing_ends_answers_that_wait_for_bandwidth(void **state)
{
    (void)state;
    const strl_server_desc desc = {.bandwidth = 8192};
    for (unsigned round = 0; round < 3; round++) {
        strl_server *server = must_open(&desc);
        int clients[CLIENTS];
        for (unsigned i = 0; i < CLIENTS; i++)
            clients[i] = ask(strl_server_port(server), "/big.stroll");
        assert_int_equal(status_of(clients[0]), 200); /* it is under way: of the others some wait already */
        strl_sleep_ns(round * 30 * MS);
        uint64_t begin_ns = strl_clock_ns();
        strl_server_close(server, round * MS);
        assert_true(strl_clock_ns() - begin_ns < PATIENCE_NS);
        for (unsigned i = 0; i < CLIENTS; i++)
            wait_for_end(clients[i]);
    }
}

typedef struct visitor {
    strl_thread *thread;
    _Atomic uint16_t *port;
    atomic_bool *over;
    unsigned answered;
} visitor;

static void visit(void *context)
{
    visitor *self = context;
    static const char request[] = "GET /big.stroll HTTP/1.1\r\nHost: x\r\nRange: bytes=0-99\r\n\r\n";
    while (!atomic_load(self->over)) {
        int made = connect_to(atomic_load(self->port));
        if (made < 0)
            continue;
        send(made, request, sizeof request - 1, MSG_NOSIGNAL);
        self->answered += status_of(made) == 206;
        close(made);
    }
}

static void closing_while_connections_arrive_loses_none_to_others(void **state)
{
    (void)state;
    const strl_server_desc desc = {0};
    visitor visitors[4];
    _Atomic uint16_t port = 0;
    atomic_bool over = false;
    unsigned answered = 0;
    strl_server *server = must_open(&desc);
    atomic_store(&port, strl_server_port(server));
    for (unsigned i = 0; i < 4; i++) {
        visitors[i] = (visitor){.port = &port, .over = &over};
        assert_int_equal(strl_thread_start(&visitors[i].thread, visit, &visitors[i], NULL), STRL_OK);
    }
    for (unsigned round = 0; round < 15; round++) {
        strl_sleep_ns(3 * MS);
        strl_server_close(server, 0);
        server = must_open(&desc);
        atomic_store(&port, strl_server_port(server));
    }
    int last = ask(strl_server_port(server), "/big.stroll");
    assert_int_equal(status_of(last), 200);
    wait_for_end(last);
    atomic_store(&over, true);
    for (unsigned i = 0; i < 4; i++) {
        strl_thread_join(visitors[i].thread);
        answered += visitors[i].answered;
    }
    assert_true(answered > 0);
    strl_server_close(server, 0);
}

/* Listings, whose text waits in memory while the bandwidth lets nothing through. */
static void answers_under_way_hold_no_more_memory_than_they_may(void **state)
{
    (void)state;
    char name[64];
    for (unsigned i = 0; i < 200; i++) {
        snprintf(name, sizeof name, "a-file-with-a-long-name-%04u.stroll", i);
        put_file(name, 1);
    }
    const strl_server_desc desc = {.bandwidth = 1024, .held_bytes = 100000};
    strl_server *server = must_open(&desc);
    int clients[CLIENTS];
    unsigned taken = 0, refused = 0;
    for (unsigned i = 0; i < CLIENTS; i++)
        clients[i] = ask(strl_server_port(server), "/?format=json");
    strl_sleep_ns(300 * MS);      /* the head of an answer costs no bandwidth, that of a small body does */
    strl_server_close(server, 0); /* what waits is let go */
    for (unsigned i = 0; i < CLIENTS; i++) {
        int status = status_of(clients[i]);
        taken += status == 200;
        refused += status == 503;
        wait_for_end(clients[i]);
    }
    assert_true(taken >= 1 && taken <= 4);
    assert_true(refused >= 1);
}

/* A copy of the smallest container of several treelets. */
static void put_container(void)
{
    char path[400];
    const char *root = getenv("STRL_TEST_ROOT");
    static uint8_t bytes[1 << 20];
    snprintf(path, sizeof path, "%s/tests/container/golden/v1-treelets.stroll", root ? root : ".");
    FILE *from = fopen(path, "rb");
    assert_non_null(from);
    size_t size = fread(bytes, 1, sizeof bytes, from);
    fclose(from);
    snprintf(path, sizeof path, "%s/model.stroll", strl_test_path("served"));
    FILE *to = fopen(path, "wb");
    assert_non_null(to);
    assert_int_equal(fwrite(bytes, 1, size, to), size);
    fclose(to);
}

typedef struct asker {
    strl_thread *thread;
    uint16_t port;
    unsigned answered, wrong;
} asker;

static void ask_for_nodes(void *context)
{
    asker *self = context;
    for (unsigned i = 0; i < 40; i++) {
        int client = ask(self->port, "/model.stroll?subtrees=0:0/65535");
        int status = status_of(client);
        self->answered += status == 200;
        self->wrong += status != 200;
        wait_for_end(client);
    }
}

/* Two threads answer, so that one query at a time is at work; none is refused for that. */
static void queries_that_come_together_take_turns(void **state)
{
    (void)state;
    const strl_server_desc desc = {.threads = 2};
    asker askers[CLIENTS];
    put_container();
    strl_server *server = must_open(&desc);
    for (unsigned i = 0; i < CLIENTS; i++) {
        askers[i] = (asker){.port = strl_server_port(server)};
        assert_int_equal(strl_thread_start(&askers[i].thread, ask_for_nodes, &askers[i], NULL), STRL_OK);
    }
    for (unsigned i = 0; i < CLIENTS; i++) {
        strl_thread_join(askers[i].thread);
        assert_int_equal(askers[i].answered, 40);
        assert_int_equal(askers[i].wrong, 0);
    }
    strl_server_close(server, 0);
}

/* ---- turns */

enum { LEVELS = 600, ROUNDS = 100 };

/* A model whose nodes lie below each other, and the query for each with all below it: 180,000 nodes are looked at. */
typedef struct long_work {
    fixture fixture;
    char request[LEVELS * 12];
} long_work;

static long_work *make_long_work(void)
{
    long_work *self = calloc(1, sizeof *self);
    strl_error err = {0};
    assert_non_null(self);
    fixture_setup(&self->fixture, LEVELS, 1);
    if (fixture_write(&self->fixture, &err) != STRL_OK)
        fail_msg("%s", err.message);
    size_t at = 0;
    for (unsigned i = 0; i < self->fixture.node_count; i++)
        at += (size_t)snprintf(self->request + at, sizeof self->request - at, "%s%u/65535",
                               i ? "," : "GET /model.stroll?subtrees=0:", i);
    at += (size_t)snprintf(self->request + at, sizeof self->request - at, " HTTP/1.1\r\nHost: x\r\n\r\n");
    assert_true(at < sizeof self->request);
    return self;
}

static void drop_long_work(long_work *self)
{
    fixture_teardown(&self->fixture);
    free(self);
}

/* To its end, so that the connection can be asked again. Its status; 0 where the connection ended. */
static int take_answer(int client)
{
    char head[2000] = "", some[65536];
    for (size_t have = 0; !strstr(head, "\r\n\r\n"); have++)
        if (have + 1 == sizeof head || recv(client, head + have, 1, 0) != 1)
            return 0;
    const char *length = strstr(head, "Content-Length: ");
    assert_non_null(length);
    for (size_t left = strtoul(length + 16, NULL, 10); left > 0;) {
        ssize_t got = recv(client, some, left < sizeof some ? left : sizeof some, 0);
        if (got <= 0)
            return 0;
        left -= (size_t)got;
    }
    return atoi(head + 9);
}

static void say(int client, const char *request)
{
    assert_int_equal(send(client, request, strlen(request), MSG_NOSIGNAL), strlen(request));
}

/* The least time that it takes, of some. */
static uint64_t time_of(const long_work *work)
{
    const strl_server_desc desc = {.folder = work->fixture.folder};
    strl_server *server = must_open(&desc);
    int client = connect_to(strl_server_port(server));
    uint64_t least_ns = UINT64_MAX;
    for (unsigned i = 0; i < 4; i++) {
        uint64_t begin_ns = strl_clock_ns();
        say(client, work->request);
        assert_int_equal(take_answer(client), 200);
        uint64_t took_ns = strl_clock_ns() - begin_ns;
        least_ns = took_ns < least_ns ? took_ns : least_ns;
    }
    close(client);
    strl_server_close(server, 0);
    return least_ns;
}

/* One turn is a hundredth of it. Where the machine does something else for long the turn may be late, but not each
 * time. */
static void a_query_at_work_is_not_idle(void **state)
{
    (void)state;
    long_work *work = make_long_work();
    const strl_server_desc desc = {.folder = work->fixture.folder, .timeout_ns = time_of(work) / 4};
    strl_server *server = must_open(&desc);
    int status = 0;
    for (unsigned round = 0; round < ROUNDS && status != 200; round++) {
        int client = connect_to(strl_server_port(server));
        send(client, work->request, strlen(work->request), MSG_NOSIGNAL);
        status = take_answer(client);
        close(client);
    }
    assert_int_equal(status, 200);
    strl_server_close(server, 0);
    drop_long_work(work);
}

typedef struct threads {
    _Atomic uint64_t of[3]; /* that answered /0, /1 and /2 */
} threads;

static void note_thread(void *context, const char *line)
{
    static _Thread_local char here;
    threads *self = context;
    for (unsigned i = 0; i < 3; i++) {
        char target[8];
        snprintf(target, sizeof target, " /%u ", i);
        if (strstr(line, target))
            atomic_store(&self->of[i], (uint64_t)(uintptr_t)&here);
    }
}

static void wait_for_change(_Atomic uint64_t *number, uint64_t before)
{
    for (uint64_t begin_ns = strl_clock_ns(); atomic_load(number) == before; strl_sleep_ns(MS / 50))
        assert_true(strl_clock_ns() - begin_ns < PATIENCE_NS);
}

/* Of three connections to two threads, a pair of one. */
static void connect_to_one_thread(const strl_server *server, threads *found, int client[2])
{
    static const unsigned pairs[3][2] = {{0, 1}, {0, 2}, {1, 2}};
    int all[3];
    unsigned pair = 0;
    for (unsigned i = 0; i < 3; i++) {
        char request[64];
        snprintf(request, sizeof request, "GET /%u HTTP/1.1\r\nHost: x\r\n\r\n", i);
        all[i] = connect_to(strl_server_port(server));
        say(all[i], request);
        assert_int_equal(take_answer(all[i]), 404);
        wait_for_change(&found->of[i], 0);
    }
    while (found->of[pairs[pair][0]] != found->of[pairs[pair][1]])
        assert_true(++pair < 3);
    client[0] = all[pairs[pair][0]];
    client[1] = all[pairs[pair][1]];
    close(all[2 - pair]);
}

static void between_two_turns_others_of_the_thread_are_served(void **state)
{
    (void)state;
    long_work *work = make_long_work();
    threads found = {0};
    const strl_server_desc desc = {.folder = work->fixture.folder, .threads = 2, .log = note_thread, .context = &found};
    strl_server *server = must_open(&desc);
    bool is_between = false;
    int client[2];
    connect_to_one_thread(server, &found, client);
    for (unsigned round = 0; round < ROUNDS && !is_between; round++) {
        uint64_t before = atomic_load(&server->site.metrics.query_turns);
        say(client[0], work->request);
        wait_for_change(&server->site.metrics.query_turns, before);
        say(client[1], "GET /model.stroll HTTP/1.1\r\nHost: x\r\nRange: bytes=0-99\r\n\r\n");
        assert_int_equal(take_answer(client[1]), 206);
        /* where the machine was slow it may have ended already */
        is_between = atomic_load(&server->site.queries) == 1;
        assert_int_equal(take_answer(client[0]), 200);
    }
    assert_true(is_between);
    close(client[0]);
    close(client[1]);
    strl_server_close(server, 0);
    drop_long_work(work);
}

/* Of all addresses that are known. */
static double least_left(strl__rates *rates)
{
    double least = 1;
    strl_mutex_lock(&rates->mutex);
    for (unsigned i = 0; i < STRL__RATE_SETS * STRL__RATE_WAYS; i++) {
        const strl__rate_slot *slot = &rates->slots[i / STRL__RATE_WAYS][i % STRL__RATE_WAYS];
        if (slot->last_ns && slot->tokens < least)
            least = slot->tokens;
    }
    strl_mutex_unlock(&rates->mutex);
    return least;
}

/* Who has one request only, and it is taken, gets into debt before the query ends. */
static void a_query_is_charged_after_each_turn(void **state)
{
    (void)state;
    long_work *work = make_long_work();
    const strl_server_desc desc = {.folder = work->fixture.folder, .rate = 1e-6};
    bool is_in_debt = false;
    for (unsigned round = 0; round < ROUNDS && !is_in_debt; round++) {
        strl_server *server = must_open(&desc);
        int client = connect_to(strl_server_port(server));
        say(client, work->request);
        uint64_t begin_ns = strl_clock_ns();
        while (least_left(&server->rates) >= 0)
            assert_true(strl_clock_ns() - begin_ns < PATIENCE_NS);
        is_in_debt = atomic_load(&server->site.queries) == 1;
        assert_int_equal(take_answer(client), 200);
        close(client);
        strl_server_close(server, 0);
    }
    assert_true(is_in_debt);
    drop_long_work(work);
}

typedef struct told {
    atomic_uint count;
    char sentence[400];
} told;

static void hear(void *context, const char *sentence)
{
    told *self = context;
    if (atomic_fetch_add(&self->count, 1) == 0)
        snprintf(self->sentence, sizeof self->sentence, "%s", sentence);
}

static void the_owner_is_told_what_a_stranger_is_not(void **state)
{
    (void)state;
    told owner = {0};
    const strl_server_desc desc = {.complain = hear, .context = &owner};
    strl_server *server = must_open(&desc);
    strl_file_fail_reads_after(1);
    int client = ask(strl_server_port(server), "/big.stroll?nodes=0:0");
    assert_int_equal(status_of(client), 503);
    strl_file_fail_reads_after(0);
    wait_for_end(client);
    assert_int_equal(atomic_load(&owner.count), 1);
    assert_non_null(strstr(owner.sentence, "big.stroll"));
    strl_server_close(server, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closing_ends_answers_that_wait_for_bandwidth),
        cmocka_unit_test(closing_while_connections_arrive_loses_none_to_others),
        cmocka_unit_test(queries_that_come_together_take_turns),
        cmocka_unit_test(a_query_at_work_is_not_idle),
        cmocka_unit_test(between_two_turns_others_of_the_thread_are_served),
        cmocka_unit_test(a_query_is_charged_after_each_turn),
        cmocka_unit_test(the_owner_is_told_what_a_stranger_is_not),
        cmocka_unit_test(answers_under_way_hold_no_more_memory_than_they_may),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
