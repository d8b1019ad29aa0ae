#ifndef KN_CLIENTS_VIEW_FILM_H
#define KN_CLIENTS_VIEW_FILM_H
// `knead view --video`: the moments of a recording, or what is served while it is, picture by picture to a film.
//
// A recording is stepped twice: first for what the film needs as a whole, so that neither colours nor camera jump: the
// end of the colour scale, the box of everywhere the object comes to, and how many pictures there are.
#include "clients/knead/view_options.h"

int kn_view_film(const kn_view_options *options); // an exit code, after a complaint

#endif
