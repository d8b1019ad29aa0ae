#include "clients/knead/interrupt.h"
#include <stddef.h>

volatile sig_atomic_t kn_interrupted;

// Only store the number of the signal, because little else is safe in a signal handler.
static void on_signal(int number) { kn_interrupted = number; }

void kn_interrupt_watch(void)
{
    static const int deadly[] = {SIGINT, SIGTERM, SIGHUP};
    for (int i = 0; i < 3; i++) sigaction(deadly[i], &(struct sigaction){.sa_handler = on_signal}, NULL);
}

void kn_interrupt_die(void)
{
    if (!kn_interrupted) return;
    // Restore the default action of the signal, which ends the process. Then raise the signal again.
    signal((int)kn_interrupted, SIG_DFL);
    raise((int)kn_interrupted);
}
