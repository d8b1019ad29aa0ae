#ifndef KN_CLIENTS_COMPLAIN_H
#define KN_CLIENTS_COMPLAIN_H
// Print one line on stderr in the form "knead check: what is wrong, what was expected", with the name of `subcommand`.
// A message that names a place in a file, "scene.yaml:14:9: ...", gets no prefix, because editors jump to a place at
// the beginning of a line. Return `code`, an exit code KN_EXIT_*, unchanged.
__attribute__((format(printf, 3, 4))) int kn_complain(const char *subcommand, int code, const char *format, ...);

#endif
