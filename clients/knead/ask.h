#ifndef KN_CLIENTS_ASK_H
#define KN_CLIENTS_ASK_H
// A request to a running kneadd over its control socket (server/control.h), and its answer.
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

#define KN_ASK_PATH "/run/knead/control" // where kneadd.service has it

// Sends, and waits for the answer: a new reference. NULL and one line in error: nobody serves there, or nobody answers.
json_t *kn_ask(const char *path, const json_t *request, char *error, size_t error_size);

// The same for whoever may not wait. A socket that the request has gone out on, which does not block and is the caller's;
// -1 and one line in error. What comes back on it until the first newline is the answer.
int kn_ask_begin(const char *path, const json_t *request, char *error, size_t error_size);

// What came, NULL where it is no answer: a new reference.
json_t *kn_ask_read(const char *text, size_t size);

#endif
