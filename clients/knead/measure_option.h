#ifndef KN_CLIENTS_MEASURE_OPTION_H
#define KN_CLIENTS_MEASURE_OPTION_H
// The options --color WHAT, --top QUANTITY and --at SECONDS|end of `knead view` and `knead export`.
#include "core/measure.h"

#define KN_MEASURE_WORDS "displacement|stress|residual" // the names of kn_measure

// Read a moment of a recording into the double at `at_s`: seconds, or INFINITY for "end". Return NULL, or the expected
// words if `text` is not a valid value.
const char *kn_moment_take(void *at_s, const char *text);

// Read the end of the colour scale from `text`. Return it in the SI unit of the measure, 1e-9 .. 1e12, or 0 if `text`
// is not a valid value.
double kn_measure_top(kn_measure measure, const char *text);
const char *kn_measure_top_example(kn_measure measure); // example of a scale end for help texts, like "'2 mm'"

// Return the end of the colour scale: `asked` if it is not 0, else a round number above the largest value `most` of the
// data. The scale has a smallest end, so that an object at rest does not show rounding errors as colours.
double kn_measure_scale(kn_measure measure, double asked, double most);

#endif
