#ifndef KN_CLIENTS_SHAPE_SHAPE_FILES_H
#define KN_CLIENTS_SHAPE_SHAPE_FILES_H
// Check before the fit that the outputs of `knead identify shape` can be written. No output may be an input, a file
// that the scene names, or another output.
#include "clients/shape/shape_options.h"

int kn_shape_files_try(const kn_shape_options *options); // return 0, or print an error and return an exit code

#endif
