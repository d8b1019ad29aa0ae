#ifndef KN_CLIENTS_DEVICE_H
#define KN_CLIENTS_DEVICE_H
// The virtual device: a real-time thread that asks a hand every millisecond for the pose of the tool. The thread
// publishes the pose and gives the newest force to the hand. The hand may follow a path or a pointer: the thread works
// with both.
#include "clients/knead/hand.h"
#include "clients/knead/join.h"
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>

// Function that plays one millisecond of the hand `self`. The device's thread calls it. `force` is the newest force
// since the last call, or NULL if there was none. `elapsed_ms` is 1 + the number of 1 ms cycles that the thread missed.
typedef kn_hand_out kn_device_hand(void *self, const kn_hand_force *force, int elapsed_ms);

typedef struct kn_device {
    _Atomic(int) missed; // number of 1 ms cycles that the device's thread missed
    atomic_bool done;    // true: the hand has finished, and the thread has ended
    // The fields below are private.
    kn_device_hand *hand;
    void *self;
    const char *url;
    char pose_channel[64], force_channel[64], contact_channel[64], *error;
    size_t error_size;
    int priority_error;
    kn_hand_force force;
    kn_hand_out last; // output of the hand in the last cycle in which it sent a pose
    bool fresh;
    kn_join *bus;
    atomic_bool stop;
    sem_t ready;
    pthread_t thread;
} kn_device;

// Join the message bus at `url` and start the thread of the virtual device. On failure return false with one line in
// error. `device` must be zeroed and must not move in memory.
bool kn_device_start(kn_device *device, kn_device_hand *hand, void *self, const char *url, const char *probe,
                     char *error, size_t error_size);
// Return 0 if the thread runs with SCHED_FIFO, or the errno with which the kernel refused SCHED_FIFO.
int kn_device_priority_error(const kn_device *device);
// Stop the thread and wait for its end. The tool stays where it is, and the session of its poses ends.
void kn_device_stop(kn_device *device);

// Join the message bus, play the hand and leave the bus, all in the thread of the caller. The caller calls
// kn_device_tick every millisecond until kn_device_tick returns false. `elapsed_ms` is the time since the last call.
bool kn_device_join(kn_device *device, kn_device_hand *hand, void *self, const char *url, const char *probe,
                    char *error, size_t error_size);
bool kn_device_tick(kn_device *device, int elapsed_ms);
void kn_device_leave(kn_device *device);

#endif
