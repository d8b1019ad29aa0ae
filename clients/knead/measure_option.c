#include "clients/knead/measure_option.h"
#include "clients/viewer/label.h"
#include "server/option_table.h"
#include <math.h>
#include <string.h>

const char *kn_moment_take(void *at_s, const char *text)
{
    *(double *)at_s = INFINITY;
    return strcmp(text, "end") == 0 || kn_number_take(text, -1e9, 1e9, at_s) ? NULL : "seconds, or end";
}

double kn_measure_top(kn_measure measure, const char *text)
{
    double top = 0;
    // A number without a unit is accepted only if the measure itself has no unit.
    const char *unit = *kn_measure_names[measure].unit ? kn_measure_names[measure].unit : "1";
    return kn_quantity_read(text, unit, !strcmp(unit, "1"), 1e-9, 1e12, &top) ? top : 0;
}

const char *kn_measure_top_example(kn_measure measure)
{
    static const char *const example[KN_MEASURES] = {"'2 mm'", "'5 kPa'", "0.1"};
    return example[measure];
}

double kn_measure_scale(kn_measure measure, double asked, double most)
{
    // Smallest end of the colour scale of each measure, SI units.
    static const double least[KN_MEASURES] = {1e-5, 1, 1e-3};
    return asked > 0 ? asked : kn_scale_top(fmax(most, least[measure]));
}
