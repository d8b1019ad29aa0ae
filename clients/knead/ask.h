#ifndef KN_CLIENTS_ASK_H
#define KN_CLIENTS_ASK_H
// A request to a running kneadd over its control socket (server/control.h), and its answer.
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

#define KN_ASK_PATH "/run/knead/control" // where kneadd.service has it

// Sends, and waits for the answer: a new reference. NULL and one line in error: nobody serves there, or nobody answers.
json_t *kn_ask(const char *path, const json_t *request, char *error, size_t error_size);

// Sends {"command": command} and waits for nothing. False: nobody serves there.
bool kn_ask_blindly(const char *path, const char *command);

#endif
