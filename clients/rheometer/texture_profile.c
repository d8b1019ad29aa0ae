// knead tpa: texture profile analysis, two bites by a plate wider than the specimen (Bourne 1978).
//
//     force
//       |          F1                       hardness      F1, largest force of the first bite
//       |         /|\                       cohesiveness  (A3 + A4)/(A1 + A2)
//       |        / | \         F2           springiness   way of the second bite / way of the first, from touch to
//       |       /  |  \        /|\                        full depth
//       |   A1 / A2|   \   A3 / | \ A4      resilience    A2/A1
//       +-----/----+----\-.-/--+--\-.-- time
//            down   up   A5  down up        adhesiveness  A5, by which the plate pulls on its first way up
//
//     gumminess = hardness * cohesiveness, chewiness = gumminess * springiness
//
// A1 to A4 are areas of the pressing force over the way of the plate, down or up; A5 is that of the pulling force.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "clients/cli/curve_table.h"
#include "clients/rheometer/rheometer.h"
#include <math.h>
#include <stdio.h>

static const char help[] =
    "usage: knead tpa MATERIAL|EXPR [OPTION]...\n\n"
    "Virtual rheometer, texture profile analysis: a plate presses the specimen twice (two bites). The two peaks of\n"
    "the force give hardness, cohesiveness, springiness and resilience, as in food laboratories. A plate with\n"
    "adhesion also pulls, which gives the adhesiveness.\n\n"
    "  --strain S        depth of both bites, as a share of the height of the untouched specimen (default: 50 %)\n"
    "  --speed V         speed of the plate, down and up (default: 1 mm/s)\n"
    "  --wait TIME       pause between the bites, with the plate at the height of the untouched specimen (default: 5\n"
    "                    s)\n" KN_RHEOMETER_LATTICE_HELP
    "  --adhesion P      tension at which the plate comes off, e.g. '1 kPa' (default: 0, the plate never pulls);\n"
    "                    at the latest it comes off at the height of the untouched specimen\n"
    "  --csv FILE        write bite,time_s,plate_m,strain,force_n,stress_pa; plate_m is the depth of the plate\n"
    "                    below the height of the untouched specimen\n"
    "  --png FILE        draw the curves (needs gnuplot)\n"
    "  --json            print the results as JSON\n" KN_RHEOMETER_HELP KN_RHEOMETER_AREA_HELP "\n"
    "Examples:\n"
    "    knead tpa dough --strain 50% --speed 1mm/s --wait 5 --png tpa.png\n"
    "    knead tpa jelly --strain 30%\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 a file cannot be written.\n";

static const char *const columns[] = {"bite", "time_s", "plate_m", "strain", "force_n", "stress_pa", NULL};

// State of the plate. The plate's place is the strain of a specimen that the plate just touches. peak_n: largest force
// of the present stroke. area_j, pull_j: work of the pressing and of the pulling force in the present stroke.
typedef struct plate {
    kn_rheometer *b;
    kn_table *t;
    int bite;
    bool touches;
    double from, rate_per_s, start_s; // the plate's place at time t is from + rate_per_s * (t - start_s)
    // touched: strain at the first touch of this bite; NAN: no touch yet
    double peak_n, area_j, pull_j, touched;
} plate;

// Return the place of the plate at time t, as the strain of a specimen that the plate just touches.
static double place(const plate *p, double t) { return p->from + p->rate_per_s * (t - p->start_s); }

// Append the present state to the table, and update the largest force of the stroke.
static void add(plate *p)
{
    const kn_rheometer *b = p->b;
    kn_table_add(p->t, (double[]){p->bite, b->time_s, KN_RHEOMETER_HEIGHT_M * fmax(place(p, b->time_s), 0), b->strain,
                                  b->force_n, b->stress_pa});
    p->peak_n = fmax(p->peak_n, b->force_n);
}

// Begin the contact of plate and specimen: from now on the plate imposes the strain.
static int touch(plate *p)
{
    p->touches = true;
    if (isnan(p->touched)) p->touched = p->b->strain;
    return kn_rheometer_strain(p->b, p->b->strain, p->rate_per_s);
}

// End the contact of plate and specimen: from now on the specimen recovers without load.
static int let_go(plate *p)
{
    p->touches = false;
    return kn_rheometer_load(p->b, 0);
}

// Return true if contact of plate and specimen must end or begin now, because the plate can neither pull the specimen
// harder than its adhesion nor pass through it.
static bool changes(const plate *p)
{
    if (p->touches) return p->b->stress_pa < -p->b->opt->adhesion_pa;
    return p->rate_per_s > 0 && place(p, p->b->time_s) >= p->b->strain;
}

// Find by bisection the moment at which contact begins or ends. The moment lies between `before`, an earlier state of
// the rheometer, and the present state. Leave the rheometer just after this moment.
static int find_change(plate *p, const kn_rheometer *before)
{
    double low = before->time_s, high = p->b->time_s;
    int code = KN_EXIT_OK;
    for (int i = 0; i < 50 && code == KN_EXIT_OK && high - low > 1e-12 * high; i++) {
        double middle = 0.5 * (low + high);
        *p->b = *before;
        code = kn_rheometer_advance(p->b, middle);
        if (changes(p)) high = middle;
        else low = middle;
    }
    // The last state tried may lie before the change of contact, so advance to the upper bound of the bisection.
    *p->b = *before;
    return code == KN_EXIT_OK ? kn_rheometer_advance(p->b, high) : code;
}

// Add the work of a force that changes linearly from from_n to to_n over a way of the plate.
static void add_work(plate *p, double from_n, double to_n, double way_m)
{
    const double low = fmin(from_n, to_n), high = fmax(from_n, to_n);
    // press, pull: mean of the positive and of the negative part of the force
    double press = 0.5 * (low + high), pull = 0;
    if (high <= 0) pull = -press, press = 0;
    else if (low < 0) press = 0.5 * high * high / (high - low), pull = 0.5 * low * low / (high - low);
    p->area_j += press * way_m;
    // without adhesion, the stress of an element is below 0 by rounding when the plate comes off
    if (p->b->opt->adhesion_pa > 0) p->pull_j += pull * way_m;
}

// Advance the lattice to the time until_s. Its own contact with the plate begins and ends by itself.
static int go_lattice(plate *p, double until_s)
{
    kn_rheometer *b = p->b;
    const double dt_s = b->model->def.solver.dt_s, way_m = KN_RHEOMETER_HEIGHT_M * fabs(p->rate_per_s) * dt_s;
    int code = KN_EXIT_OK;
    while (code == KN_EXIT_OK && b->time_s < until_s - 0.5 * dt_s) {
        code = kn_rheometer_advance(b, b->time_s + dt_s);
        // the force of a step holds for the whole step
        add_work(p, b->force_n, b->force_n, way_m);
        if (isnan(p->touched) && b->force_n > 0) p->touched = place(p, b->time_s - dt_s);
    }
    return code;
}

// Advance to the time until_s, and begin or end the contact of the plate on the way.
static int go(plate *p, double until_s)
{
    if (p->b->lattice_runs) return go_lattice(p, until_s);
    kn_rheometer *b = p->b, before = *b;
    double force_n = b->force_n;
    int code = kn_rheometer_advance(b, until_s);
    bool change = code == KN_EXIT_OK && changes(p);
    if (change) code = find_change(p, &before);
    // Add the work of the force over the last interval of the plate's way, by the trapezoidal rule.
    double way = KN_RHEOMETER_HEIGHT_M * fabs(p->rate_per_s);
    add_work(p, force_n, b->force_n, way * (b->time_s - before.time_s));
    if (change && code == KN_EXIT_OK) {
        code = p->touches ? let_go(p) : touch(p);
        add(p);
        // After the change of contact, compute the rest of the interval. The contact may change once more in the rest.
        if (code == KN_EXIT_OK && until_s > b->time_s + 1e-9) return go(p, until_s);
    }
    return code;
}

// Simulate one stroke of the plate, down or up, or a wait (rate_per_s = 0).
static int stroke(plate *p, double from, double rate_per_s, double seconds)
{
    enum { SAMPLES = 250 };
    int code = KN_EXIT_OK;
    p->from = from;
    p->rate_per_s = rate_per_s;
    p->start_s = p->b->time_s;
    p->peak_n = p->area_j = p->pull_j = 0;
    if (p->b->lattice_runs) {
        code = rate_per_s != 0 ? kn_rheometer_strain(p->b, from, rate_per_s) : kn_rheometer_load(p->b, 0);
    } else if (p->touches) { // the plate reverses its direction while it touches the specimen
        code = kn_rheometer_strain(p->b, p->b->strain, rate_per_s);
        if (code == KN_EXIT_OK && changes(p)) code = let_go(p);
    } else if (changes(p)) code = touch(p);
    if (code == KN_EXIT_OK) add(p);
    for (int i = 1; i <= SAMPLES && code == KN_EXIT_OK && seconds > 0; i++) {
        code = go(p, p->start_s + seconds * i / SAMPLES);
        add(p);
    }
    return code;
}

// Results of one bite (one movement of the plate down and up).
typedef struct bite {
    double peak_n, down_j, up_j, pull_j, touched;
} bite;

// Simulate one bite: the plate moves down, moves up, and waits.
static int take_bite(plate *p, int number, double wait_s, bite *r)
{
    const kn_rheometer_options *opt = p->b->opt;
    double rate = opt->speed_m_s / KN_RHEOMETER_HEIGHT_M, seconds = opt->strain / rate;
    char label[32];
    p->bite = number;
    p->touched = NAN;
    snprintf(label, sizeof label, "%s bite%s", number == 1 ? "first" : "second", p->b->lattice_runs ? ", lattice" : "");
    kn_table_series(p->t, label);
    int code = stroke(p, 0, rate, seconds);
    // If the plate never touched the specimen, take the full depth as the place of the touch.
    *r = (bite){.peak_n = p->peak_n, .down_j = p->area_j, .touched = isnan(p->touched) ? opt->strain : p->touched};
    if (code == KN_EXIT_OK) code = stroke(p, opt->strain, -rate, seconds);
    r->up_j = p->area_j;
    r->pull_j = p->pull_j;
    if (code == KN_EXIT_OK && (p->touches || p->b->lattice_runs))
        code = let_go(p); // the plate is back at the height of the untouched specimen
    return code == KN_EXIT_OK && wait_s > 0 ? stroke(p, 0, 0, wait_s) : code;
}

// The texture of one specimen: the numbers that two bites give.
typedef struct texture {
    double hardness_n, second_n, cohesiveness, springiness, resilience, adhesiveness_j;
} texture;

static texture texture_of(const kn_rheometer_options *opt, const bite r[2])
{
    return (texture){.hardness_n = r[0].peak_n,
                     .second_n = r[1].peak_n,
                     .cohesiveness = (r[1].down_j + r[1].up_j) / (r[0].down_j + r[0].up_j),
                     .springiness = (opt->strain - r[1].touched) / opt->strain,
                     .resilience = r[0].up_j / r[0].down_j,
                     .adhesiveness_j = r[0].pull_j};
}

// Print the results of both bites, and add them to the JSON list `runs`.
static void print(const char *name, const bite r[2], const texture *x)
{
    const double gumminess_n = x->hardness_n * x->cohesiveness, chewiness_n = gumminess_n * x->springiness;
    json_t *row = kn_result_add("runs");
    kn_result_text(row, "of", name);
    kn_result_number(row, "hardness_n", x->hardness_n);
    kn_result_number(row, "second_peak_n", x->second_n);
    kn_result_number(row, "cohesiveness", x->cohesiveness);
    kn_result_number(row, "springiness", x->springiness);
    kn_result_number(row, "resilience", x->resilience);
    kn_result_number(row, "adhesiveness_j", x->adhesiveness_j);
    kn_result_number(row, "gumminess_n", gumminess_n);
    kn_result_number(row, "chewiness_n", chewiness_n);
    printf("\n%-10s %10s %10s %12s %12s\n", name, "peak N", "touch mm", "down N mm", "up N mm");
    for (int i = 0; i < 2; i++)
        printf("%-10s %10.4g %10.3f %12.5g %12.5g\n", i ? "second" : "first", r[i].peak_n,
               1e3 * KN_RHEOMETER_HEIGHT_M * r[i].touched, 1e3 * r[i].down_j, 1e3 * r[i].up_j);
    printf("\nhardness      %.4g N (%.4g gf), the first peak; the second %.4g N\n", x->hardness_n,
           x->hardness_n / KN_GF_N, x->second_n);
    printf("cohesiveness  %.4f, area of the second bite divided by that of the first\n", x->cohesiveness);
    printf("springiness   %.4f, travel of the second bite divided by that of the first\n", x->springiness);
    printf("resilience    %.4f, area of the first bite's upstroke divided by that of its downstroke\n", x->resilience);
    printf("adhesiveness  %.4g N mm, area by which the plate pulls after the first bite\n", 1e3 * x->adhesiveness_j);
    printf("gumminess     %.4g N, hardness times cohesiveness\n", gumminess_n);
    printf("chewiness     %.4g N, gumminess times springiness\n", chewiness_n);
}

static const kn_axes axes[] = {
    {.x_label = "time, s", .y_label = "force, N", .x = 1, .y = 4, .x_scale = 1, .y_scale = 1},
    {.x_label = "plate below the untouched top, mm",
     .y_label = "force, N",
     .x = 2,
     .y = 4,
     .x_scale = 1e3,
     .y_scale = 1}};

static void title(const kn_rheometer *b, char *text, size_t size)
{
    const kn_rheometer_options *opt = b->opt;
    snprintf(text, size, "texture profile of %s, 1 cm cube: to %g %% at %g mm/s, %g s between", b->title,
             100 * opt->strain, 1e3 * opt->speed_m_s, opt->wait_s);
}

static int run(kn_rheometer *b, kn_table *t)
{
    const kn_rheometer_options *opt = b->opt;
    const double stroke_s = opt->strain * KN_RHEOMETER_HEIGHT_M / opt->speed_m_s;
    int code = kn_rheometer_time_step(b, stroke_s, 500);
    if (code != KN_EXIT_OK) return code;
    kn_rheometer_print(b);
    printf("test      twice to %g %% at %g mm/s, %g s between\n", 100 * opt->strain, 1e3 * opt->speed_m_s, opt->wait_s);
    t->pairs = b->model;
    for (int lattice = 0; lattice <= (b->model != NULL) && code == KN_EXIT_OK; lattice++) {
        plate p = {.b = b, .t = t};
        bite r[2];
        kn_rheometer_choose(b, lattice);
        kn_rheometer_fresh(b);
        kn_rheometer_bar(b, 4 * stroke_s + opt->wait_s);
        code = take_bite(&p, 1, opt->wait_s, &r[0]);
        if (code == KN_EXIT_OK) code = take_bite(&p, 2, 0, &r[1]);
        kn_rheometer_bar_end(b);
        const texture x = texture_of(opt, r);
        if (code == KN_EXIT_OK) print(lattice ? "lattice" : "element", r, &x);
    }
    return code;
}

int kn_tpa_main(int argc, char **argv)
{
    static const kn_experiment experiment = {"tpa", help, columns, run, axes, title};
    return kn_rheometer_main(&experiment, (kn_rheometer_options){.strain = 0.5, .speed_m_s = 1e-3, .wait_s = 5}, argc,
                             argv);
}
