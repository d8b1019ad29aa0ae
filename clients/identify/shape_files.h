#ifndef KN_CLIENTS_IDENTIFY_SHAPE_FILES_H
#define KN_CLIENTS_IDENTIFY_SHAPE_FILES_H
// Whether what `knead identify shape` is asked to write can be written, before its work: no output is an input, what
// the scene names among them, or another output.
#include "clients/identify/shape_options.h"

int kn_shape_files_try(const kn_shape_options *options); // an exit code, after a complaint

#endif
