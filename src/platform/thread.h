/* Threads, mutexes, conditions, clock, processor and memory facts. Thin, so that platform/web can answer too. */
#ifndef STRL_PLATFORM_THREAD_H
#define STRL_PLATFORM_THREAD_H

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"

typedef struct strl_thread strl_thread;
typedef pthread_mutex_t strl_mutex;
typedef pthread_cond_t strl_condition;
typedef pthread_once_t strl_once;
#define STRL_ONCE_INIT PTHREAD_ONCE_INIT

strl_status strl_thread_start(strl_thread **thread, void (*run)(void *context), void *context, strl_error *err);
void strl_thread_join(strl_thread *thread); /* waits and releases; NULL is legal */

/* Runs `run` in the first call of this `once`, a static of the caller's, whichever thread that is; others wait for it.
 */
void strl_once_run(strl_once *once, void (*run)(void));

void strl_mutex_init(strl_mutex *mutex);
void strl_mutex_deinit(strl_mutex *mutex);
void strl_mutex_lock(strl_mutex *mutex);
bool strl_mutex_try_lock(strl_mutex *mutex); /* false where another thread has it */
void strl_mutex_unlock(strl_mutex *mutex);
void strl_condition_init(strl_condition *condition);
void strl_condition_deinit(strl_condition *condition);
void strl_condition_wait(strl_condition *condition, strl_mutex *mutex);
void strl_condition_signal(strl_condition *condition);
void strl_condition_broadcast(strl_condition *condition);

uint64_t strl_clock_ns(void);      /* monotonic */
uint64_t strl_clock_wall_ns(void); /* since 1970, as the system's clock is set */
uint64_t strl_clock_cpu_ns(void);  /* processor time of this process, all threads */
void strl_sleep_ns(uint64_t ns);
unsigned strl_cpu_count(void); /* processors this process may use, at least 1 */
/* What this thread has made the system fetch from a disk so far and waited for: blocks of 512 bytes and pages, as the
 * system counts them. It does not grow where a thread never waits for a disk. */
uint64_t strl_thread_disk_waits(void);
uint64_t strl_process_rss_bytes(void);      /* the operating system's resident set now; 0 where it does not tell */
uint64_t strl_process_peak_rss_bytes(void); /* the operating system's peak resident set, children included */
void strl_process_forget_peak(void);        /* counts the peak anew from here on, where the system can */
/* Makes room for `wanted` open files as far as the system lets this process; how many it may have then. */
uint64_t strl_process_allow_files(uint64_t wanted);
void strl_cpu_model(char *model, size_t size); /* as the system names it; "unknown" where it does not */

#endif
