#ifndef KN_CLIENTS_YAML_PATCH_H
#define KN_CLIENTS_YAML_PATCH_H
// Replacement of one block of a YAML text. The rest of the text stays byte for byte as its author wrote it: comments,
// order and line ends.
//
//     material: dough                        A block is a key of the outermost mapping with its value. It reaches
//     quality:          <-- begins           from the key's line to the last line that holds a part of the value.
//       fast: ...       <-- ends             Comments and empty lines between it and the next key do not belong to it.
//     # of the mesh
//     mesh: ...
#include <stdbool.h>
#include <stddef.h>

// Find the bytes of the block of `key` in `text`, [*begin, *end). If the text does not have this key, the range is
// empty and lies at the end of the text. Return false with one clause in error if the text is not YAML or its outermost
// mapping is in braces: inside braces a new line is not a new key.
bool kn_yaml_patch_find(const char *text, const char *key, size_t *begin, size_t *end, char *error, size_t error_size);

// Return `text` with the block of `key` replaced by `block`, e.g. "quality:\n  fast: ...\n". An empty `block` removes
// the old block. The new block gets the line ends of the text. The caller frees the result. Return NULL with one clause
// in error on failure.
char *kn_yaml_patch(const char *text, const char *key, const char *block, char *error, size_t error_size);

#endif
