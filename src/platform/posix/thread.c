#include "platform/thread.h"

#include <assert.h>
#include <errno.h>
#include <signal.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

struct strl_thread {
    pthread_t handle;
    void (*run)(void *context);
    void *context;
};

static void *thread_main(void *argument)
{
    strl_thread *thread = argument;
    thread->run(thread->context);
    return NULL;
}

/* The host's signal handlers belong on the host's threads: ours start with every signal blocked. */
static int create_blocked(strl_thread *thread)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int code = pthread_create(&thread->handle, NULL, thread_main, thread);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return code;
}

strl_status strl_thread_start(strl_thread **thread, void (*run)(void *context), void *context, strl_error *err)
{
    *thread = NULL;
    strl_thread *made = strl__alloc_zero(1, sizeof *made);
    if (!made)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to start a thread");
    made->run = run;
    made->context = context;
    int code = create_blocked(made);
    if (code) {
        strl__free(made);
        char buffer[128];
        return strl__fail(err, STRL_ERR_MEMORY, "cannot start a thread: %s", strerror_r(code, buffer, sizeof buffer));
    }
    *thread = made;
    return STRL_OK;
}

void strl_thread_join(strl_thread *thread)
{
    if (!thread)
        return;
    pthread_join(thread->handle, NULL);
    strl__free(thread);
}

/* These fail only where the caller broke their contract. */
static void must(int code)
{
    assert(code == 0);
    (void)code;
}

void strl_once_run(strl_once *once, void (*run)(void))
{
    must(pthread_once(once, run));
}

void strl_mutex_init(strl_mutex *mutex)
{
    must(pthread_mutex_init(mutex, NULL));
}

void strl_mutex_deinit(strl_mutex *mutex)
{
    must(pthread_mutex_destroy(mutex));
}

void strl_mutex_lock(strl_mutex *mutex)
{
    must(pthread_mutex_lock(mutex));
}

bool strl_mutex_try_lock(strl_mutex *mutex)
{
    int code = pthread_mutex_trylock(mutex);
    if (code != EBUSY)
        must(code);
    return code == 0;
}

void strl_mutex_unlock(strl_mutex *mutex)
{
    must(pthread_mutex_unlock(mutex));
}

void strl_condition_init(strl_condition *condition)
{
    must(pthread_cond_init(condition, NULL));
}

void strl_condition_deinit(strl_condition *condition)
{
    must(pthread_cond_destroy(condition));
}

void strl_condition_signal(strl_condition *condition)
{
    must(pthread_cond_signal(condition));
}

void strl_condition_broadcast(strl_condition *condition)
{
    must(pthread_cond_broadcast(condition));
}

void strl_condition_wait(strl_condition *condition, strl_mutex *mutex)
{
    must(pthread_cond_wait(condition, mutex));
}
