#ifndef KN_CLIENTS_VIEW_H
#define KN_CLIENTS_VIEW_H
// What one picture and a film of `knead view` have in common.
#include "clients/knead/view_options.h"
#include "clients/viewer/scale.h"

// The scale of --color: to --top, or to a round number that holds the most. Without --color to 1.
kn_scale kn_view_scale(const kn_view_options *options, double most);

#endif
