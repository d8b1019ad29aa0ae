#ifndef KN_CLIENTS_INTERRUPT_H
#define KN_CLIENTS_INTERRUPT_H
// Ctrl-C, a hang-up or a plain kill where there is something to clear away first: watched from when there is, then died
// of, so that whoever started us sees what ended us.
#include <signal.h>

extern volatile sig_atomic_t kn_interrupted; // the number of the signal that came, 0: none did

void kn_interrupt_watch(void);
void kn_interrupt_die(void); // of the one that came, if one did

#endif
