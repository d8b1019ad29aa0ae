#ifndef KN_CLIENTS_MEASURE_OPTION_H
#define KN_CLIENTS_MEASURE_OPTION_H
// The options --color WHAT and --top QUANTITY of `knead view` and `knead export`.
#include "core/measure.h"

#define KN_MEASURE_EXPECTED "displacement, stress or residual"

bool kn_measure_take(const char *text, int *measure); // find the measure named `text`, store its number (kn_measure)
// Read the end of the colour scale from `text`. Return it in the SI unit of the measure, 1e-9 .. 1e12, or 0 if `text`
// is not a valid value.
double kn_measure_top(kn_measure measure, const char *text);
const char *kn_measure_top_example(kn_measure measure); // example of a scale end for help texts, like "'2 mm'"

// Return the end of the colour scale: `asked` if it is not 0, else a round number above the largest value `most` of the
// data. The scale has a smallest end, so that an object at rest does not show rounding errors as colours.
double kn_measure_scale(kn_measure measure, double asked, double most);

#endif
