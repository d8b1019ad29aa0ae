#ifndef KN_CLIENTS_COMPLAIN_H
#define KN_CLIENTS_COMPLAIN_H
// Print one line on stderr, like "knead check: what is wrong, what was expected". A message that names a place in a
// file, "scene.yaml:14:9: ...", gets no prefix, because editors jump to a place at the beginning of a line. Return
// `code`, one of KN_EXIT_*.
__attribute__((format(printf, 3, 4))) int kn_complain(const char *subcommand, int code, const char *format, ...);

#endif
