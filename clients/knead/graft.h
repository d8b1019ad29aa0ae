#ifndef KN_CLIENTS_GRAFT_H
#define KN_CLIENTS_GRAFT_H
// One block of a YAML text exchanged, the rest left as its author wrote it, byte for byte: comments, order, line ends.
//
//     material: dough                        a block is a key of the outermost mapping with its value, from the key's
//     quality:          <-- begins           line to the last line that has something of the value; comments and empty
//       fast: ...       <-- ends             lines between it and the next key are not its
//     # of the mesh
//     mesh: ...
#include <stdbool.h>
#include <stddef.h>

// Bytes of the block of key in text: [*begin, *end), empty at the text's end when there is none. False and one clause
// in error: not YAML, or the outermost mapping is in braces, where a line more is not a key more.
bool kn_graft_find(const char *text, const char *key, size_t *begin, size_t *end, char *error, size_t error_size);

// text with the block exchanged for another ("quality:\n  fast: ...\n"; "": removed), in the line ends of the text. For
// the caller to free; NULL and one clause in error.
char *kn_graft(const char *text, const char *key, const char *block, char *error, size_t error_size);

#endif
