#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "clients/shape/shape_command.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double atm_pa = 101325;

void kn_shape_print_object(const kn_shape_options *o, const kn_candidate *c)
{
    double extent_m[3];
    kn_model_def_extent(&c->scene->model, extent_m);
    printf("object     %s: %.3g x %.3g x %.3g mm, %d nodes\n", o->scene.scene_path, 1e3 * extent_m[0],
           1e3 * extent_m[1], 1e3 * extent_m[2], c->first->node_count);
    kn_result_text(kn_result(), "scene", o->scene.scene_path);
    if (c->one_skin)
        printf("note       the scene's object.pressure=object is ignored: "
               "each structure has gas in every cell or in none\n");
}

// Write a parameter as "1.03 [0.98 .. 1.08]", as "< 0.05", or as "-" if the parameter is not an unknown of the fit.
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
static void print_row(const kn_measurement *m, const kn_candidate *c, double off, double delta)
{
    char text[2][48], mm[6][16], share[16] = "-", apart[16] = "-";
    if (!c->found) {
        printf("%-13s could not be fitted: %s\n", c->name, c->why);
        return;
    }
    const kn_surface_misfit *f = &c->misfit[0];
    if (m->has_force) snprintf(share, sizeof share, "%.2g", 100 * c->force_share);
    if (!isnan(delta)) snprintf(apart, sizeof apart, "%.4g", delta);
    printf("%-13s %-24s %-24s %7s %8s %7s>%-7s%7s>%-7s %6s %7.3g %7s %5d %6.0f%s\n", c->name,
           number(&c->known[0], c->gas, atm_pa, text[0]), number(&c->known[c->gas], c->area, 1, text[1]),
           millimetres(f->height_m, mm[0]), millimetres(f->outline_m, mm[1]), millimetres(f->bulge_m[0][0], mm[2]),
           millimetres(f->bulge_m[1][0], mm[3]), millimetres(f->bulge_m[0][1], mm[4]),
           millimetres(f->bulge_m[1][1], mm[5]), share, off, apart, c->presses, c->seconds,
           !c->settled ? "  not settled"
           : c->early  ? "  stopped early"
                       : "");
}

// Write the misfit of every surface to --json.
static void tell_surfaces(json_t *row, const kn_measurement *m, const kn_candidate *c)
{
    json_t *all = json_array();
    json_object_set_new(row, "surfaces", all);
    for (int i = 0; i < m->surfaces; i++) {
        const kn_surface_misfit *f = &c->misfit[i];
        json_t *one = json_object();
        json_array_append_new(all, one);
        kn_result_number(one, "time_s", m->moment_s[i]);
        kn_result_number(one, "height_rms_m", f->height_m);
        kn_result_number(one, "outline_rms_m", f->outline_m);
        kn_result_number(one, "bulge_x_measured_m", f->bulge_m[0][0]);
        kn_result_number(one, "bulge_x_m", f->bulge_m[1][0]);
        kn_result_number(one, "bulge_y_measured_m", f->bulge_m[0][1]);
        kn_result_number(one, "bulge_y_m", f->bulge_m[1][1]);
    }
}

// Write one structure to --json.
static void tell(const kn_measurement *m, const kn_candidate *c, double off, double delta)
{
    json_t *row = kn_result_add("structures");
    if (!row) return;
    kn_result_text(row, "structure", c->name);
    if (!c->found) kn_result_text(row, "no_answer", c->why);
    if (!c->found) return;
    if (c->gas) kn_parameter_estimate_tell(row, &c->known[0]);
    if (c->area) kn_parameter_estimate_tell(row, &c->known[c->gas]);
    if (c->area) kn_result_number(row, "gamma_factor", c->area_factor);
    tell_surfaces(row, m, c);
    if (m->has_force) kn_result_number(row, "force_rms_share", c->force_share);
    kn_result_number(row, "off", off);
    kn_result_number(row, "delta_aicc", delta);
    kn_result_number(row, "independent_readings", c->independent);
    kn_result_integer(row, "presses", c->presses);
    kn_result_number(row, "seconds", c->seconds);
    kn_result_bool(row, "settled", c->settled);
    kn_result_bool(row, "stopped_early", c->early);
    kn_result_bool(row, "no_gas_left", c->no_gas_left);
    if (!m->align) return;
    kn_result_number(row, "shift_x_m", c->shift_m[0]);
    kn_result_number(row, "shift_y_m", c->shift_m[1]);
}

void kn_shape_print(const kn_measurement *m, const kn_candidate *c, int count, const kn_structure_verdict *v)
{
    printf("\n%-13s %-24s %-24s %7s %8s %13s%13s %6s %7s %7s %5s %6s\n", "structure", "P0 atm", "gamma", "rms mm",
           "outline", "bulge x mm", "bulge y mm", "force%", "off", "dAICc", "press", "s");
    for (int i = 0; i < count; i++) {
        print_row(m, &c[i], v->off[i], v->delta[i]);
        tell(m, &c[i], v->off[i], v->delta[i]);
    }
    if (v->best < 0) return;
    const kn_candidate *best = &c[v->best];
    if (m->align)
        printf("the images lie %.3g mm to the right of and %.3g mm above their stated place\n", 1e3 * best->shift_m[0],
               1e3 * best->shift_m[1]);
    printf("\n%s\n", v->words);
    kn_result_text(kn_result(), "best", best->name);
    kn_result_bool(kn_result(), "explained", v->explained);
    if (v->rival >= 0) kn_result_text(kn_result(), "rival", c[v->rival].name);
    kn_result_text(kn_result(), "words", v->words);
    kn_result_integer(kn_result(), "readings", m->readings);
}

void kn_shape_print_finer(const kn_measurement *m, const kn_candidate *best, const kn_candidate *finer)
{
    // Compare the residuals with those of the coarser cells. The change of the residuals is the part of the misfit that
    // comes from the lattice.
    const double off = sqrt(finer->sum / m->readings), was = sqrt(best->sum / m->readings);
    double sum = 0;
    putchar('\n');
    print_row(m, finer, off, (double)NAN);
    for (int i = 0; finer->found && i < m->readings; i++)
        sum += pow(finer->residual[i] - best->residual[i], 2) / m->readings;
    const double moved = sqrt(sum);
    if (!finer->found)
        printf("The best structure could not be pressed with halved cells, "
               "so the lattice's part of the misfit is unknown.\n");
    // A change of more than half of the misfit means that the lattice matters.
    else if (moved > 0.5 * was)
        printf("Halving the cells changes the predictions by %.1f times the noise. "
               "Structure and parameters hold for this lattice only; --set object.spacing='%g mm' sets a finer one.\n",
               moved, 1e3 * finer->scene->model.spacing_m);
    else
        printf("Halving the cells changes the predictions by %.1f times the noise. "
               "The lattice is not the cause of the misfit.\n",
               moved);
    if (!kn_result()) return;
    json_t *row = json_object();
    json_object_set_new(kn_result(), "halved_cells", row);
    if (!finer->found) return;
    kn_result_number(row, "off", off);
    kn_result_number(row, "moved", moved);
    tell_surfaces(row, m, finer);
    if (m->has_force) kn_result_number(row, "force_rms_share", finer->force_share);
}

// ---- the plot of --png

// WIDE, HIGH: width and height of the plot [pixels]; ACROSS: largest number of heights drawn along one axis of a map
enum { WIDE = 1180, HIGH = 900, ACROSS = 200 };

// Write one map of heights, or of the difference a - b, thinned to about ACROSS heights along each axis.
static void map(FILE *f, const kn_range *r, const uint16_t *a, double a_step_m, const uint16_t *b, double b_step_m)
{
    const int every = (r->width > r->height ? r->width : r->height) / ACROSS + 1;
    for (int y = 0; y < r->height; y += every)
        for (int x = 0; x < r->width; x += every) {
            const size_t at = (size_t)y * (size_t)r->width + (size_t)x;
            const double z_m = a[at] == 0 || (b && b[at] == 0)
                                   ? (double)NAN
                                   : (a[at] - 1) * a_step_m - (b ? (b[at] - 1) * b_step_m : 0);
            fprintf(f, "%.5g %.5g %.5g\n", 1e3 * (r->left_m + x * r->pixel_m), 1e3 * (r->top_m - y * r->pixel_m),
                    1e3 * z_m);
        }
    fputs("e\n", f);
}

void kn_shape_draw_range(const kn_candidate *c, kn_range frame, uint16_t *level)
{
    const kn_surface *s = c->surface.mesh;
    frame.left_m += c->shift_m[0];
    frame.top_m += c->shift_m[1];
    kn_range_draw(&frame, (const float(*)[3])c->pressed.shape_m[0], s->triangle_count, (const int(*)[3])s->triangle,
                  level);
}

// Draw the measured image, the fitted structure in the same frame, and the difference.
static void draw_maps(FILE *f, const kn_measurement *m, const kn_candidate *best, uint16_t *level)
{
    const kn_surface_residual *r = &m->surface[0];
    const double most = ceil(3e3 * hypot(best->misfit[0].height_m, r->noise_m) / 0.05) * 0.05;
    kn_range frame = r->frame;
    frame.step_m = 1e-6 * ceil(3 * r->tall_m / 0.065534);
    kn_shape_draw_range(best, frame, level);
    frame.left_m += best->shift_m[0];
    frame.top_m += best->shift_m[1];
    fprintf(f,
            "set size ratio -1\nset xlabel 'x, mm'\nset ylabel 'y, mm'\nset cblabel 'height, mm'\n"
            "set palette defined (0 '#440154', 1 '#3b528b', 2 '#21918c', 3 '#5ec962', 4 '#fde725')\n"
            "set cbrange [%g:%g]\nset title 'measured'\nplot '-' with image notitle\n",
            1e3 * r->frame.lowest_m, 1e3 * r->frame.highest_m);
    map(f, &frame, r->level, r->frame.step_m, NULL, 0);
    fprintf(f, "set title 'found: %s'\nplot '-' with image notitle\n", best->name);
    map(f, &frame, level, frame.step_m, NULL, 0);
    fprintf(f,
            "set palette defined (-1 '#0072b2', 0 '#f4f4f4', 1 '#d55e00')\nset cbrange [%g:%g]\n"
            "set cblabel 'found - measured, mm'\nset title 'difference'\nplot '-' with image notitle\n",
            -most, most);
    map(f, &frame, level, frame.step_m, r->level, r->frame.step_m);
}

// Draw the measured and the fitted force over time.
static void draw_force(FILE *f, const kn_measurement *m, const kn_candidate *best)
{
    double residual[KN_FORCE_SPANS], model_n[KN_FORCE_SPANS];
    if (!m->has_force) return;
    kn_force_residual_compare(&m->force, &m->press, &best->pressed, residual, model_n);
    fputs("set size noratio\nset title 'force'\nset xrange [*:] noextend\nset xlabel 'time, s'\nset ylabel 'force, "
          "N'\nset key top right\n"
          "plot '-' with points lt 1 ps 0.5 title 'measured', '-' with lines lt 2 title 'found'\n",
          f);
    for (int pass = 0; pass < 2; pass++) {
        for (int b = 0; b < m->force.spans; b++)
            fprintf(f, "%.6g %.6g\n", m->force.span_s[b], pass ? model_n[b] : m->force.span_n[b]);
        fputs("e\n", f);
    }
}

int kn_shape_draw(const kn_shape_options *o, const kn_measurement *m, const kn_candidate *best)
{
    const kn_range *frame = &m->surface[0].frame;
    const bool pictured = frame->width > 0;
    int code = KN_EXIT_OK;
    uint16_t *level = malloc((size_t)frame->width * (size_t)frame->height * sizeof *level + 1);
    if (!level) return kn_complain("identify shape", KN_EXIT_INTERNAL, "out of memory");
    FILE *f = kn_plot_open("identify shape", o->png, WIDE, HIGH, &code);
    if (f) {
        fputs(pictured ? "set multiplot layout 2,2\n" : "", f);
        if (pictured) draw_maps(f, m, best, level);
        draw_force(f, m, best);
        fputs(pictured ? "unset multiplot\n" : "", f);
        code = kn_plot_close(f, "identify shape", o->png);
    }
    free(level);
    return code;
}
