#ifndef KN_CLIENTS_COMPLAIN_H
#define KN_CLIENTS_COMPLAIN_H
// A line on stderr as every subcommand says it, "knead check: what is wrong, what was expected". What names a place in
// a file, "scene.yaml:14:9: ...", is left as it is: editors jump there. Returns code, one of KN_EXIT_*.
__attribute__((format(printf, 3, 4))) int kn_complain(const char *subcommand, int code, const char *format, ...);

#endif
