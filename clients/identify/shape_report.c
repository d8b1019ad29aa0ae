#include "clients/identify/shape_report.h"
#include "clients/knead/result.h"
#include <math.h>
#include <stdio.h>

static const double atm_pa = 101325;

void kn_shape_print_object(const kn_shape_options *o, const kn_candidate *c)
{
    double extent_m[3];
    kn_model_def_extent(&c->scene->model, extent_m);
    printf("object     %s: %.3g x %.3g x %.3g mm, %d nodes\n", o->scene.scene_path, 1e3 * extent_m[0],
           1e3 * extent_m[1], 1e3 * extent_m[2], c->first->node_count);
    kn_result_text(kn_result(), "scene", o->scene.scene_path);
    if (c->one_skin)
        printf("note       the scene's object.pressure=object is ignored: each structure has gas in every cell or in "
               "none\n");
}

// Write a parameter as "1.03 [0.98 .. 1.08]", "< 0.05", or "-" if it is not an unknown.
static const char *number(const kn_parameter_estimate *k, bool sought, double unit, char text[48])
{
    const kn_fit_interval *i = &k->interval;
    if (!sought) snprintf(text, 48, "-");
    else if (k->known == KN_KNOWN)
        snprintf(text, 48, "%.4g [%.4g .. %.4g]", k->value / unit, i->low / unit, i->high / unit);
    else if (k->known == KN_AT_MOST) snprintf(text, 48, "< %.3g", i->high / unit);
    else if (k->known == KN_AT_LEAST) snprintf(text, 48, "> %.3g", i->low / unit);
    else snprintf(text, 48, "%.3g, unknown", k->value / unit);
    return text;
}

static const char *millimetres(double m, char text[16])
{
    if (isnan(m)) snprintf(text, 16, "-");
    else snprintf(text, 16, "%.3f", 1e3 * m);
    return text;
}

// Print the row of one candidate in the table of structures.
static void print_row(const kn_evidence *e, const kn_candidate *c, double off, double delta)
{
    char text[2][48], mm[6][16], share[16] = "-", apart[16] = "-";
    if (!c->found) {
        printf("%-13s could not be fitted: %s\n", c->name, c->why);
        return;
    }
    const kn_relief_misfit *m = &c->misfit[0];
    if (e->pulled) snprintf(share, sizeof share, "%.2g", 100 * c->pull_share);
    if (!isnan(delta)) snprintf(apart, sizeof apart, "%.4g", delta);
    printf("%-13s %-24s %-24s %7s %8s %7s>%-7s%7s>%-7s %6s %7.3g %7s %5d %6.0f%s\n", c->name,
           number(&c->known[0], c->gas, atm_pa, text[0]), number(&c->known[c->gas], c->area, 1, text[1]),
           millimetres(m->height_m, mm[0]), millimetres(m->outline_m, mm[1]), millimetres(m->bulge_m[0][0], mm[2]),
           millimetres(m->bulge_m[1][0], mm[3]), millimetres(m->bulge_m[0][1], mm[4]),
           millimetres(m->bulge_m[1][1], mm[5]), share, off, apart, c->presses, c->seconds,
           !c->settled ? "  not settled"
           : c->early  ? "  stopped early"
                       : "");
}

// Write the misfit of every surface to --json.
static void tell_surfaces(json_t *row, const kn_evidence *e, const kn_candidate *c)
{
    json_t *all = json_array();
    json_object_set_new(row, "surfaces", all);
    for (int i = 0; i < e->reliefs; i++) {
        const kn_relief_misfit *m = &c->misfit[i];
        json_t *one = json_object();
        json_array_append_new(all, one);
        kn_result_number(one, "time_s", e->moment_s[i]);
        kn_result_number(one, "height_rms_m", m->height_m);
        kn_result_number(one, "outline_rms_m", m->outline_m);
        kn_result_number(one, "bulge_x_measured_m", m->bulge_m[0][0]);
        kn_result_number(one, "bulge_x_m", m->bulge_m[1][0]);
        kn_result_number(one, "bulge_y_measured_m", m->bulge_m[0][1]);
        kn_result_number(one, "bulge_y_m", m->bulge_m[1][1]);
    }
}

// Write one structure to --json.
static void tell(const kn_evidence *e, const kn_candidate *c, double off, double delta)
{
    json_t *row = kn_result_add("structures");
    if (!row) return;
    kn_result_text(row, "structure", c->name);
    if (!c->found) kn_result_text(row, "no_answer", c->why);
    if (!c->found) return;
    if (c->gas) kn_parameter_estimate_tell(row, &c->known[0]);
    if (c->area) kn_parameter_estimate_tell(row, &c->known[c->gas]);
    if (c->area) kn_result_number(row, "gamma_factor", c->area_factor);
    tell_surfaces(row, e, c);
    if (e->pulled) kn_result_number(row, "force_rms_share", c->pull_share);
    kn_result_number(row, "off", off);
    kn_result_number(row, "delta_aicc", delta);
    kn_result_number(row, "independent_readings", c->worth);
    kn_result_integer(row, "presses", c->presses);
    kn_result_number(row, "seconds", c->seconds);
    kn_result_bool(row, "settled", c->settled);
    kn_result_bool(row, "stopped_early", c->early);
    kn_result_bool(row, "no_gas_left", c->no_gas_left);
    if (!e->align) return;
    kn_result_number(row, "shift_x_m", c->shift_m[0]);
    kn_result_number(row, "shift_y_m", c->shift_m[1]);
}

void kn_shape_print(const kn_shape_options *o, const kn_evidence *e, const kn_candidate *c, int count,
                    const kn_verdict *v)
{
    (void)o;
    printf("\n%-13s %-24s %-24s %7s %8s %13s%13s %6s %7s %7s %5s %6s\n", "structure", "P0 atm", "gamma", "rms mm",
           "outline", "bulge x mm", "bulge y mm", "force%", "off", "dAICc", "press", "s");
    for (int i = 0; i < count; i++) {
        print_row(e, &c[i], v->off[i], v->delta[i]);
        tell(e, &c[i], v->off[i], v->delta[i]);
    }
    if (v->best < 0) return;
    const kn_candidate *best = &c[v->best];
    if (e->align)
        printf("the images lie %.3g mm to the right of and %.3g mm above their stated place\n", 1e3 * best->shift_m[0],
               1e3 * best->shift_m[1]);
    printf("\n%s\n", v->words);
    kn_result_text(kn_result(), "best", best->name);
    kn_result_bool(kn_result(), "explained", v->explained);
    if (v->rival >= 0) kn_result_text(kn_result(), "rival", c[v->rival].name);
    kn_result_text(kn_result(), "words", v->words);
    kn_result_integer(kn_result(), "readings", e->readings);
}

void kn_shape_print_finer(const kn_evidence *e, const kn_candidate *best, const kn_candidate *finer)
{
    // Compare the residuals with those of the coarser cells: the change is the share of the misfit that comes from the
    // lattice.
    const double off = sqrt(finer->sum / e->readings), was = sqrt(best->sum / e->readings);
    double sum = 0;
    putchar('\n');
    print_row(e, finer, off, (double)NAN);
    for (int i = 0; finer->found && i < e->readings; i++)
        sum += pow(finer->residual[i] - best->residual[i], 2) / e->readings;
    const double moved = sqrt(sum);
    if (!finer->found) printf("so the lattice's part of the misfit is unknown.\n");
    // A change of more than half of the misfit means that the lattice matters.
    else if (moved > 0.5 * was)
        printf("Halving the cells changes the predictions by %.1f times the noise: structure and parameters hold for "
               "this lattice only; --set object.spacing='%g mm' sets a finer one.\n",
               moved, 1e3 * finer->scene->model.spacing_m);
    else
        printf("Halving the cells changes the predictions by %.1f times the noise: the lattice is not the cause of the "
               "misfit.\n",
               moved);
    if (!kn_result()) return;
    json_t *row = json_object();
    json_object_set_new(kn_result(), "halved_cells", row);
    if (!finer->found) return;
    kn_result_number(row, "off", off);
    kn_result_number(row, "moved", moved);
    tell_surfaces(row, e, finer);
    if (e->pulled) kn_result_number(row, "force_rms_share", finer->pull_share);
}
