#ifndef KN_CLIENTS_VIEW_FILM_H
#define KN_CLIENTS_VIEW_FILM_H
// `knead view --video`: writes a film of a recording, or of the object that a running kneadd serves.
// A recording is replayed twice. The first pass finds values that hold for the whole film: the end of the colour scale,
// the box of all places that the object reaches, and the number of pictures. So neither colours nor camera jump.
#include "clients/knead/view_options.h"

// Write the film that the options ask for. Return 0, or print an error message and return an exit code.
int kn_view_film(const kn_view_options *options);

#endif
