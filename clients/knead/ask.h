#ifndef KN_CLIENTS_ASK_H
#define KN_CLIENTS_ASK_H
// Requests to a running kneadd over its control socket (server/control.h), and the answers.
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

#define KN_ASK_PATH "/run/knead/control" // path of the control socket in the unit file kneadd.service

// Send a control request to the running kneadd and wait for the answer. Return the answer as a new reference. Return
// NULL with one line in error if no server listens at `path`, or if no answer arrives.
json_t *kn_ask(const char *path, const json_t *request, char *error, size_t error_size);

// Send a control request to the running kneadd without waiting for the answer. Return a non-blocking socket that the
// caller owns, or -1 with one line in error. The answer is the text received on the socket up to the first newline.
int kn_ask_begin(const char *path, const json_t *request, char *error, size_t error_size);

// Parse the text that the control socket has received. Return the answer as a new reference, or NULL if the text is not
// a complete answer.
json_t *kn_ask_read(const char *text, size_t size);

#endif
