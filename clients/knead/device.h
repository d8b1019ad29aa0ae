#ifndef KN_CLIENTS_DEVICE_H
#define KN_CLIENTS_DEVICE_H
// The virtual device: a real-time thread that moves a hand at 1 kHz, publishes its poses and feels the newest force,
// through stock liblcm.
#include "clients/knead/hand.h"
#include <lcm/lcm.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>

typedef struct kn_device {
    kn_hand hand; // the thread's; after kn_device_stop the caller's. Before that, hand.trip[0 .. trips-1] may be read
    // news of the thread, at any time:
    _Atomic(int) mode, trips, tries; // kn_hand_mode; a trip's `cleared` is known when mode has left RETREAT
    _Atomic(int) path_ms, given_mn;
    _Atomic(const char *) piece;
    _Atomic(int) missed;             // cycles this thread came too late for
    _Atomic(const kn_path *) next_path; // for the thread: taken before the next try begins, NULL then
    // private
    const char *url;
    char pose_channel[64], force_channel[64], *error;
    size_t error_size;
    int priority_error;
    kn_hand_force force;
    bool fresh;
    lcm_t *lcm;
    atomic_bool stop;
    sem_t ready;
    pthread_t thread;
} kn_device;

// Joins the bus and starts moving. False and one line in error. device must be zeroed and stays where it is.
bool kn_device_start(kn_device *device, const kn_hand_def *def, const char *url, const char *probe, char *error,
                     size_t error_size);
// 0, or why there is no SCHED_FIFO (errno).
int kn_device_priority_error(const kn_device *device);
bool kn_device_done(const kn_device *device); // the hand is DONE or GAVE_UP
void kn_device_stop(kn_device *device);       // and joins; the tool stops where it is

#endif
