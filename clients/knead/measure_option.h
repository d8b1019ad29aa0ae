#ifndef KN_CLIENTS_MEASURE_OPTION_H
#define KN_CLIENTS_MEASURE_OPTION_H
// --color WHAT and --top QUANTITY, as `knead view` and `knead export` take them.
#include "core/gauge.h"

#define KN_MEASURE_EXPECTED "displacement, stress or residual"

bool kn_measure_take(const char *text, int *measure);        // one of kn_measure
double kn_measure_top(kn_measure measure, const char *text); // in its unit, SI; 0: it is none, 1e-9 .. 1e12
const char *kn_measure_top_example(kn_measure measure);      // "'2 mm'"

// The end of the scale: what was asked for, or a round number that holds the most; of an object at rest never so little
// that a picture is made of rounding.
double kn_measure_scale(kn_measure measure, double asked, double most);

#endif
