#include "interrupt.h"

#include <signal.h>

static volatile sig_atomic_t interrupted; /* set by the signal handler alone */

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

void strl_cli_catch_interrupts(void)
{
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
}

bool strl_cli_interrupted(void)
{
    return interrupted != 0;
}
