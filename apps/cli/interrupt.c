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
    /* Whoever presses Ctrl-C again does not want to wait for the next step. The other two come twice of themselves: a
     * closed terminal's from the kernel and from the shell, timeout's to the process and to its group. */
    static const struct {
        int number, flags;
    } signals[] = {{SIGINT, SA_RESETHAND}, {SIGQUIT, SA_RESETHAND}, {SIGTERM, 0}, {SIGHUP, 0}};
    for (size_t i = 0; i < sizeof signals / sizeof *signals; i++) {
        struct sigaction action = {.sa_handler = on_signal, .sa_flags = SA_RESTART | signals[i].flags}, before;
        sigemptyset(&action.sa_mask);
        /* What was ignored stays so: under nohup the program outlives its terminal, in a script's background its
         * Ctrl-C. */
        if (sigaction(signals[i].number, NULL, &before) == 0 && before.sa_handler != SIG_IGN)
            sigaction(signals[i].number, &action, NULL);
    }
    signal(SIGXFSZ, SIG_IGN); /* a limit on the size of files is an error of writing, which says what and where */
}

bool strl_cli_interrupted(void)
{
    return interrupted != 0;
}

strl_status strl_cli_check_interrupt(strl_error *err)
{
    return interrupted ? strl__fail(err, STRL_ERR_CANCELLED, "interrupted") : STRL_OK;
}
