#include "interrupt.h"

#include <signal.h>
#include <stddef.h>

#include "base/fail.h"

static volatile sig_atomic_t interrupted; /* set by the signal handler alone */

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

void strl_cli_catch_interrupts(void)
{
    static const int signals[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT};
    struct sigaction action = {.sa_handler = on_signal, .sa_flags = SA_RESTART}, before;
    sigemptyset(&action.sa_mask);
    for (size_t i = 0; i < sizeof signals / sizeof *signals; i++) {
        /* nohup has the program outlive its terminal */
        bool outlives = signals[i] == SIGHUP && sigaction(SIGHUP, NULL, &before) == 0 && before.sa_handler == SIG_IGN;
        if (!outlives)
            sigaction(signals[i], &action, NULL);
    }
}

bool strl_cli_interrupted(void)
{
    return interrupted != 0;
}

strl_status strl_cli_check_interrupt(strl_error *err)
{
    return interrupted ? strl__fail(err, STRL_ERR_CANCELLED, "interrupted") : STRL_OK;
}
