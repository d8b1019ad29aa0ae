#ifndef KN_CLIENTS_INTERRUPT_H
#define KN_CLIENTS_INTERRUPT_H
// Handling of Ctrl-C, hang-up and SIGTERM in a program that has something to clean up. Call kn_interrupt_watch before
// creating the first file or process that needs to be cleaned up. After the clean-up call kn_interrupt_die, which ends
// the process by the signal, so that the parent process sees which signal ended it.
#include <signal.h>

extern volatile sig_atomic_t kn_interrupted; // number of the signal that this process received; 0: none

void kn_interrupt_watch(void);
// End this process by the signal that it received. Return normally if no signal was received.
void kn_interrupt_die(void);

#endif
