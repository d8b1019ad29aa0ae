#ifndef KN_CLIENTS_DEVICE_H
#define KN_CLIENTS_DEVICE_H
// The virtual device: a real-time thread that asks a hand every millisecond where the tool is, publishes that pose and
// gives the hand the newest force. Whose hand it is (a path's, a pointer's) it does not know.
#include "clients/knead/hand.h"
#include "clients/knead/join.h"
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>

// One millisecond of the hand `self`, in the device's thread. force: the newest since the last call, NULL when there
// was none; elapsed_ms: 1 + cycles that this thread came too late for.
typedef kn_hand_out kn_device_hand(void *self, const kn_hand_force *force, int elapsed_ms);

typedef struct kn_device {
    _Atomic(int) missed; // cycles this thread came too late for
    atomic_bool done;    // the hand has said so, and the thread has ended
    // private
    kn_device_hand *hand;
    void *self;
    const char *url;
    char pose_channel[64], force_channel[64], contact_channel[64], *error;
    size_t error_size;
    int priority_error;
    kn_hand_force force;
    kn_hand_out last; // that was sent
    bool fresh;
    kn_join *bus;
    atomic_bool stop;
    sem_t ready;
    pthread_t thread;
} kn_device;

// Joins the bus and starts moving. False and one line in error. device must be zeroed and stays where it is.
bool kn_device_start(kn_device *device, kn_device_hand *hand, void *self, const char *url, const char *probe,
                     char *error, size_t error_size);
// 0, or why there is no SCHED_FIFO (errno).
int kn_device_priority_error(const kn_device *device);
void kn_device_stop(kn_device *device); // and joins; the tool stops where it is, its session ends

// The same without a thread of its own: the caller calls tick every ms, elapsed_ms after the last one, until that is
// false.
bool kn_device_join(kn_device *device, kn_device_hand *hand, void *self, const char *url, const char *probe,
                    char *error, size_t error_size);
bool kn_device_tick(kn_device *device, int elapsed_ms);
void kn_device_leave(kn_device *device);

#endif
