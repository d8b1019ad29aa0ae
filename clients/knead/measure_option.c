#include "clients/knead/measure_option.h"
#include "clients/viewer/label.h"
#include "core/scene/units.h"
#include <math.h>
#include <string.h>

bool kn_measure_take(const char *text, int *measure)
{
    // Search the list of names from its end. If the name is unknown, the result is -1.
    *measure = KN_MEASURES - 1;
    while (*measure >= 0 && strcmp(kn_measure_names[*measure].name, text) != 0) --*measure;
    return *measure >= 0;
}

double kn_measure_top(kn_measure measure, const char *text)
{
    kn_quantity q;
    kn_unit unit = {0};
    char error[100];
    const char *name = kn_measure_names[measure].unit;
    // A number without a unit is accepted only if the measure itself has no unit.
    if (*name && !kn_unit_parse(&unit, name, error, sizeof error)) return 0;
    if (!kn_quantity_parse(&q, text, error, sizeof error) || (*name && q.bare)) return 0;
    if (!kn_unit_same_dimension(&q.unit, &unit)) return 0;
    const double top = kn_quantity_in(&q, &unit);
    return top >= 1e-9 && top <= 1e12 ? top : 0;
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
