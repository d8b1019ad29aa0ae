#include "core/scene/units.h"
#include "tests/check.h"

// Return the value of the text in multiples of the unit. Return NAN if either cannot be read or if the dimensions
// differ.
static double read(const char *text, const char *unit)
{
    kn_quantity q;
    kn_unit u;
    char error[128];
    if (!kn_quantity_parse(&q, text, error, sizeof error) || !kn_unit_parse(&u, unit, error, sizeof error)) return NAN;
    return kn_unit_same_dimension(&q.unit, &u) ? kn_quantity_in(&q, &u) : NAN;
}

static const char *complaint(const char *text)
{
    static char error[128];
    kn_quantity q;
    return kn_quantity_parse(&q, text, error, sizeof error) ? "" : error;
}

TEST("every unit has its SI value")
{
    static const struct {
        const char *text, *si;
        double value;
    } unit[] = {
        {"1 m", "m", 1},
        {"1 cm", "m", 1e-2},
        {"1 mm", "m", 1e-3},
        {"1 um", "m", 1e-6},
        {"1 s", "s", 1},
        {"1 ms", "s", 1e-3},
        {"1 us", "s", 1e-6},
        {"1 Hz", "1/s", 1},
        {"1 kg", "kg", 1},
        {"1 g", "kg", 1e-3},
        {"1 N", "kg*m/s^2", 1},
        {"1 mN", "N", 1e-3},
        {"1 gf", "N", 9.80665e-3},
        {"1 kgf", "N", 9.80665},
        {"1 Pa", "N/m^2", 1},
        {"1 kPa", "Pa", 1e3},
        {"1 atm", "Pa", 101325},
        {"0.1 atm", "kPa", 10.1325},
        {"101.325 kPa", "atm", 1},
        {"1 MPa", "Pa", 1e6},
        {"1 g/cm^3", "kg/m^3", 1e3},
        {"4 N/ms", "N/s", 4e3},
        {"9.81 m/s^2", "m/s^2", 9.81},
        {"1 1/Pa", "1/Pa", 1},
        {"3 cm^-2", "1/m^2", 3e4},
    };
    for (size_t i = 0; i < sizeof unit / sizeof *unit; i++) {
        double value = read(unit[i].text, unit[i].si);
        if (value != unit[i].value) KN_TEST_FAIL("%s is %.17g %s", unit[i].text, value, unit[i].si);
    }
}

TEST("the units of the food papers convert to SI")
{
    CHECK_NEAR(read("470 gf/cm^3", "Pa/m"), 470 * 9806.65, 1e-9);
    CHECK_NEAR(read("2500 gf s/cm^3", "Pa*s/m"), 2500 * 9806.65, 1e-8);
    CHECK_NEAR(read("2500 gf*s/cm^3", "Pa*s/m"), 2500 * 9806.65, 1e-8);
    CHECK_NEAR(read("80 gf/cm^2", "Pa"), 80 * 98.0665, 1e-11);
    CHECK_NEAR(read("0.0815 cm^2/gf", "1/Pa"), 0.0815 / 98.0665, 1e-18);
}

TEST("a length gives the same bits in every unit")
{
    static const char *const five_mm[] = {"5 mm", "0.5 cm", "0.005 m", "5000 um", "5e-3 m", "+.5e0cm", "50.0E-1 mm"};
    for (size_t i = 0; i < sizeof five_mm / sizeof *five_mm; i++) CHECK(read(five_mm[i], "m") == 0.005);
    CHECK(read("1.2 g/cm^3", "kg/m^3") == 1200);
    CHECK(read("0.1 kPa", "Pa") == 100);
    CHECK(read("4 N/ms", "N/ms") == 4);
}

TEST("a unit is read from left to right")
{
    CHECK(read("1 N/m/m", "Pa") == 1);
    CHECK(read("1 N/m*m", "N") == 1);
    CHECK(read("1 Pa*m^2/N", "1") == 1);
    CHECK(isnan(read("1 N/m", "N")));
    CHECK(isnan(read("1 deg", "1")));
    CHECK_NEAR(read("-90 deg", "rad"), -0.5 * acos(-1.0), 1e-15);
    CHECK_NEAR(read("1 rad/s", "deg/s"), 180 / acos(-1.0), 1e-13);
    CHECK(isnan(read("1 kg", "Pa")));
}

TEST("a quantity that cannot be read is refused with the reason")
{
    CHECK_STR(complaint("5 cm"), "");
    CHECK_STR(complaint("5"), "");
    CHECK_STR(complaint("nan"), "'nan' is not a finite number");
    CHECK_STR(complaint("inf"), "'inf' is not a finite number");
    CHECK_STR(complaint("0x10 m"), "unknown unit 'x10'");
    CHECK_STR(complaint("- 3 m"), "'- 3 m' is not a finite number");
    CHECK_STR(complaint("5 parsec"), "unknown unit 'parsec'");
    CHECK_STR(complaint("5 PA"), "unknown unit 'PA'");
    CHECK_STR(complaint("5 kg/m s^2"), "ambiguous after '/': write * or / before 's^2'");
    CHECK_STR(complaint("5 m^22"), "no one-digit power after 'm'");
    CHECK_STR(complaint("5 m^x"), "no one-digit power after 'm'");
    CHECK_STR(complaint("5 m,"), "cannot read the unit at ','");
    CHECK_STR(complaint("5 m/"), "a unit's name is missing in 'm/'");
    CHECK_STR(complaint("5 m**s"), "a unit's name is missing in 'm**s'");
    CHECK_STR(complaint("5 m*m*m*m*m*m*m*m*m"), "too many factors in the unit 'm*m*m*m*m*m*m*m*m'");
    CHECK_STR(complaint("1e99999 m"), "cannot read the exponent of '1e99999 m'");
    CHECK_STR(complaint("1e m"), "cannot read the exponent of '1e m'");
    CHECK(isinf(read("1e999 m", "m")));
    CHECK(read("1e-9999 m", "m") == 0);
}

TESTS_MAIN
