#ifndef KN_CLIENTS_LIVE_SERVER_H
#define KN_CLIENTS_LIVE_SERVER_H
// The object that kneadd serves, as an observer needs it: the scene, the newest complete mesh, the probes and the
// forces on the hands that hold the probes. The size of every message is checked before the message is decoded.
//
//     open -> listen, as often as there is time -> read the fields -> close
#include "clients/hand/bus_client.h"
#include "clients/knead_mesh.h"
#include "core/scene/scene.h"
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_live_server_probe {
    char name[KN_NAME_MAX];
    double position_m[3], orientation_wxyz[4]; // pose of the tool in the model of kneadd
    double force_n[3];                         // force that kneadd sends to the hand, N
    double gain;                               // gain that kneadd applies to the tool; 0: the tool is not in the model
    // Time of the last force message of this probe, ms of CLOCK_MONOTONIC.
    int64_t heard_ms;
    double hand_position_m[3], hand_orientation_wxyz[4]; // pose of the haptic device that controls the tool
    // Time of the last pose message of the device, ms of CLOCK_MONOTONIC; 0: none.
    int64_t hand_ms;
} kn_live_server_probe;

typedef struct kn_live_server {
    kn_bus_client *bus, *mesh_bus;
    kn_mesh mesh;          // newest surface mesh; mesh.whole is true once all positions are known
    kn_scene *scene;       // scene that kneadd serves; NULL until a scene message has arrived
    char scene_error[300]; // reason why the last scene message cannot be used; "" if it can be used
    int probe_count;
    kn_live_server_probe probe[KN_PROBES_MAX];
    int64_t heard[2]; // number of messages received from the bus and from the mesh bus
    int64_t meshes;   // number of complete meshes received
} kn_live_server;

// Join the bus and the mesh bus. The URLs are those of kn_bus_client_open and may be NULL. Return false with one line
// in error.
bool kn_live_server_open(kn_live_server *live, const char *url, const char *mesh_url, char *error, size_t error_size);

// Receive messages for up to `timeout_ms`. Return early once a message has been received.
void kn_live_server_listen(kn_live_server *live, int timeout_ms);

// Return the probe with the given name. Return NULL if no force message of the probe arrived in the last 200 ms,
// because in that case nobody holds the probe.
const kn_live_server_probe *kn_live_server_find(const kn_live_server *live, const char *name);

// Return true if a pose message of the hand that holds the probe arrived in the last 200 ms.
bool kn_live_server_held(const kn_live_server_probe *probe);

void kn_live_server_close(kn_live_server *live);

int64_t kn_live_server_now_ms(void); // return the present time of CLOCK_MONOTONIC, ms

// Requests to a running kneadd over its control socket (server/control.h), and the answers.

#define KN_LIVE_SERVER_CONTROL "/run/knead/control" // path of the control socket in the unit file kneadd.service

// Connect to a Unix socket, such as the control socket. `flags`: 0 or SOCK_NONBLOCK. Return the descriptor, or -1 with
// errno set.
int kn_live_server_dial(const char *path, int flags);

// Send a control request to the running kneadd and wait for the answer. Return the answer as a new reference. Return
// NULL with one line in error if no server listens at `path`, or if no answer arrives.
json_t *kn_live_server_ask(const char *path, const json_t *request, char *error, size_t error_size);

// Return the path of the control socket: $KNEAD_CONTROL, or KN_LIVE_SERVER_CONTROL if the variable is not set.
const char *kn_live_server_control(void);

// Get a copy of the object of the running kneadd, in the form of a snapshot file. scene: hash of the scene's text that
// the object must have. Return a file descriptor that the caller owns, or -1 with one line in error.
int kn_live_server_copy(const char *path, uint64_t scene, char *error, size_t error_size);

// Send a control request to the running kneadd without waiting for the answer. Return a non-blocking socket that the
// caller owns, or -1 with one line in error. The answer is the text received on the socket up to the first newline.
int kn_ask_begin(const char *path, const json_t *request, char *error, size_t error_size);

// Parse the text that the control socket has received. Return the answer as a new reference, or NULL if the text is not
// a complete answer.
json_t *kn_ask_read(const char *text, size_t size);

#endif
