#ifndef KN_CLIENTS_MEASURE_OPTION_H
#define KN_CLIENTS_MEASURE_OPTION_H
// The options --color WHAT and --top QUANTITY of `knead view` and `knead export`.
#include "core/gauge.h"

#define KN_MEASURE_EXPECTED "displacement, stress or residual"

bool kn_measure_take(const char *text, int *measure); // one of kn_measure
// Return the value in the measure's SI unit, 1e-9 .. 1e12, or 0 if `text` is not a valid value.
double kn_measure_top(kn_measure measure, const char *text);
const char *kn_measure_top_example(kn_measure measure); // "'2 mm'"

// Return the end of the colour scale: `asked`, or a round number above the largest value `most` if `asked` is 0. The
// scale never gets so small that an object at rest shows rounding errors.
double kn_measure_scale(kn_measure measure, double asked, double most);

#endif
