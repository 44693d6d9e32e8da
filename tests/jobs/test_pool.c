#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "jobs/pool.h"
#include "platform/thread.h"

static const unsigned thread_counts[] = {0, 1, 2, 8};
#define THREAD_COUNTS (sizeof thread_counts / sizeof *thread_counts)

static strl_pool *make_pool(unsigned threads)
{
    strl_error err = {0};
    strl_pool *pool = NULL;
    if (strl_pool_create(threads, &pool, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return pool;
}

/* cmocka's assertions jump, so jobs on other threads count what is wrong and the test looks at the count. */
typedef struct tally {
    strl_pool *pool;
    uint8_t *visits;      /* by item */
    atomic_uint busy[16]; /* by worker slot or window slot */
    atomic_uint wrong;
    uint64_t fail_from;      /* items from here on fail */
    uint64_t fail_finish_at; /* this finish fails */
    unsigned window;
    uint64_t values[16]; /* by window slot: what work leaves for finish */
    uint64_t hash;       /* of the finished items, in order */
    uint64_t finished;
    strl_cancel *cancel;
    uint64_t cancel_at;
} tally;

static tally new_tally(strl_pool *pool, uint64_t count)
{
    tally self = {.pool = pool, .fail_from = UINT64_MAX, .fail_finish_at = UINT64_MAX, .cancel_at = UINT64_MAX};
    self.visits = strl__alloc_zero(count, 1);
    assert_non_null(self.visits);
    return self;
}

static void enter(tally *self, unsigned slot)
{
    if (atomic_fetch_add(&self->busy[slot], 1) != 0)
        atomic_fetch_add(&self->wrong, 1);
}

static void leave(tally *self, unsigned slot)
{
    atomic_fetch_sub(&self->busy[slot], 1);
}

static strl_status visit(void *context, uint64_t index, unsigned worker, strl_error *err)
{
    tally *self = context;
    if (worker >= strl_pool_workers(self->pool)) {
        atomic_fetch_add(&self->wrong, 1);
        return STRL_OK;
    }
    enter(self, worker);
    self->visits[index]++;
    if (index % 97 == 0)
        strl_sleep_ns(20000);
    if (index >= self->cancel_at)
        atomic_store(&self->cancel->requested, true);
    leave(self, worker);
    if (index >= self->fail_from)
        return strl__fail(err, STRL_ERR_FORMAT, "item %u", (unsigned)index);
    return STRL_OK;
}

static void each_item_runs_once_and_no_two_share_a_worker_slot(void **state)
{
    (void)state;
    const uint64_t counts[] = {0, 1, 2, 5000};
    for (size_t t = 0; t < THREAD_COUNTS; t++)
        for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
            strl_pool *pool = make_pool(thread_counts[t]);
            assert_int_equal(strl_pool_threads(pool), thread_counts[t]);
            tally self = new_tally(pool, counts[c]);
            assert_int_equal(strl_pool_for(pool, counts[c], visit, &self, NULL, NULL), STRL_OK);
            for (uint64_t i = 0; i < counts[c]; i++)
                assert_int_equal(self.visits[i], 1);
            assert_int_equal(self.wrong, 0);
            strl__free(self.visits);
            strl_pool_destroy(pool);
        }
}

static void a_loop_returns_the_failure_of_its_lowest_failing_item(void **state)
{
    (void)state;
    for (size_t t = 0; t < THREAD_COUNTS; t++)
        for (unsigned round = 0; round < 50; round++) {
            strl_pool *pool = make_pool(thread_counts[t]);
            tally self = new_tally(pool, 1000);
            self.fail_from = 100 + round;
            strl_error err = {0};
            assert_int_equal(strl_pool_for(pool, 1000, visit, &self, NULL, &err), STRL_ERR_FORMAT);
            char expected[32];
            snprintf(expected, sizeof expected, "item %u", 100 + round);
            assert_string_equal(err.message, expected);
            for (uint64_t i = 0; i <= self.fail_from; i++)
                assert_int_equal(self.visits[i], 1);
            assert_int_equal(self.visits[999], 0);
            strl__free(self.visits);
            strl_pool_destroy(pool);
        }
}

static void a_cancelled_loop_starts_no_further_item(void **state)
{
    (void)state;
    for (size_t t = 0; t < THREAD_COUNTS; t++) {
        strl_pool *pool = make_pool(thread_counts[t]);
        strl_cancel cancel = {false};
        tally self = new_tally(pool, 100000);
        self.cancel = &cancel;
        self.cancel_at = 300;
        assert_int_equal(strl_pool_for(pool, 100000, visit, &self, &cancel, NULL), STRL_ERR_CANCELLED);
        assert_int_equal(self.visits[300], 1);
        assert_int_equal(self.visits[99999], 0);
        strl__free(self.visits);
        strl_pool_destroy(pool);
    }
}

static void cancelling_in_the_last_item_changes_nothing(void **state)
{
    (void)state;
    strl_pool *pool = make_pool(0);
    strl_cancel cancel = {false};
    tally self = new_tally(pool, 10);
    self.cancel = &cancel;
    self.cancel_at = 9;
    assert_int_equal(strl_pool_for(pool, 10, visit, &self, &cancel, NULL), STRL_OK);
    strl__free(self.visits);
    strl_pool_destroy(pool);
}

static strl_status nest(void *context, uint64_t index, unsigned worker, strl_error *err)
{
    (void)index, (void)worker;
    tally *self = context;
    tally inner = {.pool = self->pool, .fail_from = UINT64_MAX, .cancel_at = UINT64_MAX};
    uint8_t visits[64] = {0};
    inner.visits = visits;
    strl_status status = strl_pool_for(self->pool, 64, visit, &inner, NULL, err);
    for (unsigned i = 0; i < 64; i++)
        if (visits[i] != 1)
            atomic_fetch_add(&self->wrong, 1);
    atomic_fetch_add(&self->wrong, atomic_load(&inner.wrong));
    return status;
}

static void loops_nest(void **state)
{
    (void)state;
    for (size_t t = 0; t < THREAD_COUNTS; t++) {
        strl_pool *pool = make_pool(thread_counts[t]);
        tally self = {.pool = pool};
        assert_int_equal(strl_pool_for(pool, 40, nest, &self, NULL, NULL), STRL_OK);
        assert_int_equal(self.wrong, 0);
        strl_pool_destroy(pool);
    }
}

static strl_status work_item(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    tally *self = context;
    if (slot != index % self->window || worker >= strl_pool_workers(self->pool))
        atomic_fetch_add(&self->wrong, 1);
    enter(self, slot); /* left by finish: the slot belongs to the item until then */
    self->visits[index]++;
    if (index % 7 == 0)
        strl_sleep_ns(30000);
    self->values[slot] = strl__mix64(index + 1);
    return index >= self->fail_from ? strl__fail(err, STRL_ERR_LIMIT, "work %u", (unsigned)index) : STRL_OK;
}

static strl_status finish_item(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    tally *self = context;
    if (index != self->finished || worker != 0 || self->visits[index] != 1)
        atomic_fetch_add(&self->wrong, 1);
    self->hash = strl__mix64(self->hash ^ self->values[slot]);
    self->finished++;
    if (index >= self->cancel_at)
        atomic_store(&self->cancel->requested, true);
    leave(self, slot);
    return index == self->fail_finish_at ? strl__fail(err, STRL_ERR_DISK_FULL, "finish %u", (unsigned)index) : STRL_OK;
}

static void a_pipeline_finishes_in_order_for_any_threads_and_window(void **state)
{
    (void)state;
    uint64_t expected = 0;
    for (uint64_t i = 0; i < 2000; i++)
        expected = strl__mix64(expected ^ strl__mix64(i + 1));
    for (size_t t = 0; t < THREAD_COUNTS; t++)
        for (unsigned window = 1; window <= 16; window = window * 2 + (window == 1)) {
            strl_pool *pool = make_pool(thread_counts[t]);
            tally self = new_tally(pool, 2000);
            self.window = window;
            assert_int_equal(strl_pool_window(pool, window), window);
            assert_int_equal(strl_pool_ordered(pool, 2000, window, work_item, finish_item, &self, NULL, NULL), STRL_OK);
            assert_int_equal(self.wrong, 0);
            assert_int_equal(self.finished, 2000);
            assert_true(self.hash == expected);
            strl__free(self.visits);
            strl_pool_destroy(pool);
        }
}

static void a_pipeline_fails_as_one_thread_would(void **state)
{
    (void)state;
    for (size_t t = 0; t < THREAD_COUNTS; t++)
        for (unsigned round = 0; round < 40; round++) {
            strl_pool *pool = make_pool(thread_counts[t]);
            tally self = new_tally(pool, 1000);
            self.window = 16;
            self.fail_from = 60;
            self.fail_finish_at = round % 2 ? 59 : 60;
            strl_error err = {0};
            strl_status status = strl_pool_ordered(pool, 1000, 16, work_item, finish_item, &self, NULL, &err);
            assert_int_equal(status, round % 2 ? STRL_ERR_DISK_FULL : STRL_ERR_LIMIT);
            assert_string_equal(err.message, round % 2 ? "finish 59" : "work 60");
            assert_int_equal(self.finished, 60);
            assert_int_equal(self.wrong, 0);
            assert_int_equal(self.visits[59 + 17], 0);
            strl__free(self.visits);
            strl_pool_destroy(pool);
        }
}

static void a_cancelled_pipeline_finishes_nothing_more(void **state)
{
    (void)state;
    for (size_t t = 0; t < THREAD_COUNTS; t++) {
        strl_pool *pool = make_pool(thread_counts[t]);
        strl_cancel cancel = {false};
        tally self = new_tally(pool, 1000);
        self.window = 8;
        self.cancel = &cancel;
        self.cancel_at = 100;
        strl_status status = strl_pool_ordered(pool, 1000, 8, work_item, finish_item, &self, &cancel, NULL);
        assert_int_equal(status, STRL_ERR_CANCELLED);
        assert_int_equal(self.finished, 101);
        strl__free(self.visits);
        strl_pool_destroy(pool);
    }
}

typedef struct journal {
    strl_pool *pool;
    atomic_uint ran;
    unsigned order[100];
} journal;

typedef struct entry {
    journal *journal;
    unsigned index;
} entry;

static void write_entry(void *context)
{
    entry *self = context;
    unsigned at = atomic_fetch_add(&self->journal->ran, 1);
    self->journal->order[at] = self->index;
}

static void submitted_jobs_run_in_order_and_before_destroy_returns(void **state)
{
    (void)state;
    for (size_t t = 0; t < THREAD_COUNTS; t++) {
        journal log = {.pool = make_pool(thread_counts[t])};
        entry entries[100];
        for (unsigned i = 0; i < 100; i++) {
            entries[i] = (entry){&log, i};
            assert_int_equal(strl_pool_submit(log.pool, write_entry, &entries[i], NULL), STRL_OK);
        }
        strl_pool_destroy(log.pool);
        assert_int_equal(log.ran, 100);
        for (unsigned i = 0; i < 100 && thread_counts[t] < 2; i++)
            assert_int_equal(log.order[i], i);
    }
}

static void sleep_a_millisecond(void *context)
{
    strl_sleep_ns(1000000);
    atomic_fetch_add((atomic_uint *)context, 1);
}

static void without_threads_submitted_jobs_wait_for_a_pump_that_keeps_its_budget(void **state)
{
    (void)state;
    strl_pool *pool = make_pool(0);
    atomic_uint ran = 0;
    for (unsigned i = 0; i < 20; i++)
        assert_int_equal(strl_pool_submit(pool, sleep_a_millisecond, &ran, NULL), STRL_OK);
    assert_int_equal(ran, 0);
    assert_int_equal(strl_pool_pump(pool, 0), 1);
    uint64_t some = strl_pool_pump(pool, 3000000);
    assert_in_range(some, 1, 3);
    assert_int_equal(strl_pool_pump(pool, UINT64_MAX), 19 - some);
    assert_int_equal(ran, 20);
    assert_int_equal(strl_pool_pump(pool, UINT64_MAX), 0);
    strl_pool_destroy(pool);
}

static strl_status all_calls(unsigned threads)
{
    strl_pool *pool = NULL;
    strl_error err = {0};
    uint8_t visits[200] = {0};
    atomic_uint ran = 0;
    strl_status status = strl_pool_create(threads, &pool, &err);
    if (status == STRL_OK) {
        tally self = {.pool = pool, .visits = visits, .window = 4};
        self.fail_from = self.fail_finish_at = self.cancel_at = UINT64_MAX;
        status = strl_pool_ordered(pool, 200, 4, work_item, finish_item, &self, NULL, &err);
    }
    if (status == STRL_OK)
        status = strl_pool_submit(pool, sleep_a_millisecond, &ran, &err);
    strl_pool_destroy(pool);
    if (status != STRL_OK)
        assert_true(status == STRL_ERR_MEMORY && err.status == status && err.message[0]);
    else
        assert_int_equal(ran, 1);
    return status;
}

static void every_failed_allocation_is_a_clean_failure(void **state)
{
    (void)state;
    for (size_t t = 0; t < THREAD_COUNTS; t++) {
        uint64_t budget = 0;
        strl_status status;
        do {
            strl__alloc_fail_after(++budget);
            status = all_calls(thread_counts[t]);
            strl__alloc_fail_after(0);
        } while (status != STRL_OK);
        /* pool, workers, a thread each, the window and the submitted job: all were reached */
        assert_int_equal(budget, 1 + 2 + thread_counts[t] + 1 + 1);
    }
}

static void too_many_threads_are_refused(void **state)
{
    (void)state;
    strl_pool *pool = NULL;
    assert_int_equal(strl_pool_create(1u << 20, &pool, NULL), STRL_ERR_ARGUMENT);
    assert_null(pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_item_runs_once_and_no_two_share_a_worker_slot),
        cmocka_unit_test(a_loop_returns_the_failure_of_its_lowest_failing_item),
        cmocka_unit_test(a_cancelled_loop_starts_no_further_item),
        cmocka_unit_test(cancelling_in_the_last_item_changes_nothing),
        cmocka_unit_test(loops_nest),
        cmocka_unit_test(a_pipeline_finishes_in_order_for_any_threads_and_window),
        cmocka_unit_test(a_pipeline_fails_as_one_thread_would),
        cmocka_unit_test(a_cancelled_pipeline_finishes_nothing_more),
        cmocka_unit_test(submitted_jobs_run_in_order_and_before_destroy_returns),
        cmocka_unit_test(without_threads_submitted_jobs_wait_for_a_pump_that_keeps_its_budget),
        cmocka_unit_test(every_failed_allocation_is_a_clean_failure),
        cmocka_unit_test(too_many_threads_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
