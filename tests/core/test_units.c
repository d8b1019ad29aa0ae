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

TEST("every unit has its SI value, to the bit, and a unit is read from left to right")
{
    const char *equal =
        "1 m=1 m;1 cm=1e-2 m;1 mm=1e-3 m;1 um=1e-6 m;1 s=1 s;1 ms=1e-3 s;1 us=1e-6 s;1 Hz=1 1/s;1 kg=1 kg;1 g=1e-3 kg;"
        "1 N=1 kg*m/s^2;1 mN=1e-3 N;1 gf=9.80665e-3 N;1 kgf=9.80665 N;1 Pa=1 N/m^2;1 kPa=1e3 Pa;1 MPa=1e6 Pa;"
        "1 atm=101325 Pa;0.1 atm=10.1325 kPa;101.325 kPa=1 atm;1 g/cm^3=1e3 kg/m^3;4 N/ms=4e3 N/s;4 N/ms=4 N/ms;"
        "9.81 m/s^2=9.81 m/s^2;1 1/Pa=1 1/Pa;3 cm^-2=3e4 1/m^2;5 mm=0.005 m;0.5 cm=0.005 m;5000 um=0.005 m;"
        "5e-3 m=0.005 m;+.5e0cm=0.005 m;50.0E-1 mm=0.005 m;1.2 g/cm^3=1200 kg/m^3;0.1 kPa=100 Pa;"
        "1 N/m/m=1 Pa;1 N/m*m=1 N;1 Pa*m^2/N=1 1;1e-9999 m=0 m;1e999 m=inf m;";
    char text[32], si[32];
    double value;
    int count = 0, size;
    for (; sscanf(equal, "%31[^=]=%lf %31[^;];%n", text, &value, si, &size) == 3; equal += size, count++)
        if (read(text, si) != value) KN_TEST_FAIL("%s is %.17g %s", text, read(text, si), si);
    CHECK(count == 39 && !*equal);
}

TEST("the units of the food papers convert to SI")
{
    CHECK_NEAR(read("470 gf/cm^3", "Pa/m"), 470 * 9806.65, 1e-9);
    CHECK_NEAR(read("2500 gf s/cm^3", "Pa*s/m"), 2500 * 9806.65, 1e-8);
    CHECK_NEAR(read("2500 gf*s/cm^3", "Pa*s/m"), 2500 * 9806.65, 1e-8);
    CHECK_NEAR(read("80 gf/cm^2", "Pa"), 80 * 98.0665, 1e-11);
    CHECK_NEAR(read("0.0815 cm^2/gf", "1/Pa"), 0.0815 / 98.0665, 1e-18);
}

TEST("a unit of another dimension is refused, and angles are a dimension")
{
    CHECK(isnan(read("1 N/m", "N")));
    CHECK(isnan(read("1 deg", "1")));
    CHECK_NEAR(read("-90 deg", "rad"), -0.5 * acos(-1.0), 1e-15);
    CHECK_NEAR(read("1 rad/s", "deg/s"), 180 / acos(-1.0), 1e-13);
    CHECK(isnan(read("1 kg", "Pa")));
}

TEST("a quantity that cannot be read is refused with the reason")
{
    static const char *const bad[][2] = {
        {"5 cm", ""},
        {"5", ""},
        {"nan", "'nan' is not a finite number"},
        {"inf", "'inf' is not a finite number"},
        {"0x10 m", "unknown unit 'x10'"},
        {"- 3 m", "'- 3 m' is not a finite number"},
        {"5 parsec", "unknown unit 'parsec'"},
        {"5 PA", "unknown unit 'PA'"},
        {"5 kg/m s^2", "ambiguous after '/': write * or / before 's^2'"},
        {"5 m^22", "no one-digit power after 'm'"},
        {"5 m^x", "no one-digit power after 'm'"},
        {"5 m,", "cannot read the unit at ','"},
        {"5 m/", "a unit's name is missing in 'm/'"},
        {"5 m**s", "a unit's name is missing in 'm**s'"},
        {"5 m*m*m*m*m*m*m*m*m", "too many factors in the unit 'm*m*m*m*m*m*m*m*m'"},
        {"1e99999 m", "cannot read the exponent of '1e99999 m'"},
        {"1e m", "cannot read the exponent of '1e m'"},
    };
    for (int i = 0; i < COUNT(bad); i++) {
        char error[128] = "";
        kn_quantity q;
        CHECK(kn_quantity_parse(&q, bad[i][0], error, sizeof error) == !*error);
        CHECK_STR(error, bad[i][1]);
    }
}
