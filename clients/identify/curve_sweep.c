// Read sweeps: storage and loss modulus over frequency. See curve.h.
#include "clients/identify/curve_parts.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <math.h>
#include <stdio.h>

// Indices of columns of the sheet; -1: the sheet has no such column. `modulus`, `tangent` and `phase` are searched only
// if the sheet lacks G' or G''.
typedef struct columns {
    int frequency, storage, loss, modulus, tangent, phase;
} columns;

static bool is_whole(const columns *c) { return c->storage >= 0 && c->loss >= 0; }

static int choose(kn_curve_file *f, columns *c)
{
    kn_sheet *s = &f->sheet;
    int code = KN_EXIT_OK;
    *c = (columns){-1, -1, -1, -1, -1, -1};
    c->frequency = kn_role_find(s, KN_FREQUENCY, &code);
    if (code == KN_EXIT_OK) c->storage = kn_role_find(s, KN_STORAGE, &code);
    if (code == KN_EXIT_OK) c->loss = kn_role_find(s, KN_LOSS, &code);
    if (code == KN_EXIT_OK && c->storage < 0) c->modulus = kn_role_find(s, KN_MODULUS, &code);
    if (code == KN_EXIT_OK && !is_whole(c)) c->tangent = kn_role_find(s, KN_TANGENT, &code);
    if (code == KN_EXIT_OK && !is_whole(c) && c->tangent < 0) c->phase = kn_role_find(s, KN_PHASE, &code);
    if (code != KN_EXIT_OK) return code;
    if (c->frequency < 0)
        return kn_sheet_complain(s, s->header_line, 1,
                                 "no frequency, expected a column like 'frequency_hz' or 'omega [rad/s]'");
    if (is_whole(c) || ((c->storage >= 0 || c->modulus >= 0) && (c->tangent >= 0 || c->phase >= 0))) return KN_EXIT_OK;
    return kn_sheet_complain(s, s->header_line, 1,
                             "no storage and loss modulus, expected two columns like G' [Pa] and G'' "
                             "[Pa], or |G*| and tan delta or phase angle");
}

// Check that the phase angle is between 0 and 90 degrees. Beyond a right angle, cosine and tangent change their signs,
// so a later complaint would name negative moduli, which are not in the file.
static int check_phase(kn_curve_file *f, const kn_readings *r, const columns *c)
{
    const double right = acos(-1.0) / 2;
    for (int i = 0; i < r->count && c->phase >= 0; i++)
        if (r->other[i] <= 0 || r->other[i] >= right * (1 - 1e-9))
            return kn_sheet_complain(&f->sheet, r->line[i], 1, "phase angle of %.6g deg, expected one between 0 and 90",
                                     90 * r->other[i] / right);
    return KN_EXIT_OK;
}

// Compute G' and G'' from |G*| or G' with tan delta or the phase angle.
static void to_parts(kn_readings *r, const columns *c)
{
    for (int i = 0; i < r->count && !is_whole(c); i++) {
        const double tangent = c->tangent >= 0 ? r->other[i] : tan(r->other[i]);
        if (c->storage < 0) r->value[i] /= sqrt(1 + tangent * tangent);
        r->other[i] = r->value[i] * tangent;
    }
}

static int check(kn_curve_file *f, const kn_readings *r)
{
    for (int i = 0; i < r->count; i++) {
        if (!(r->time_s[i] > 0))
            return kn_sheet_complain(&f->sheet, r->line[i], 1, "frequency of %g Hz, expected one above 0",
                                     r->time_s[i]);
        if (!(r->value[i] > 0 && r->other[i] > 0 && isfinite(r->value[i]) && isfinite(r->other[i])))
            return kn_sheet_complain(&f->sheet, r->line[i], 1,
                                     "storage modulus %g Pa and loss modulus %g Pa, expected both "
                                     "above 0",
                                     r->value[i], r->other[i]);
    }
    return KN_EXIT_OK;
}

int kn_curve_load_sweep(kn_curve_file *f)
{
    columns cols;
    kn_readings r = {0};
    int code = choose(f, &cols);
    // Read G' or |G*| first, and G'', tan delta or the phase angle second.
    const int first = cols.storage >= 0 ? cols.storage : cols.modulus;
    const int second = is_whole(&cols) ? cols.loss : cols.tangent >= 0 ? cols.tangent : cols.phase;
    if (code == KN_EXIT_OK) code = kn_curve_rows(f, 3, (int[]){cols.frequency, first, second});
    if (code == KN_EXIT_OK) code = kn_curve_readings(f, &r, 0, f->sheet.rows, cols.frequency, first, second, -1, true);
    kn_curve *c = code == KN_EXIT_OK ? kn_curve_add(f, KN_CURVE_SWEEP, "") : NULL;
    if (code == KN_EXIT_OK && !c) code = KN_EXIT_USAGE;
    if (code == KN_EXIT_OK) code = check_phase(f, &r, &cols);
    if (code == KN_EXIT_OK) {
        to_parts(&r, &cols);
        code = kn_curve_order(f, &r, "the modulus");
    }
    if (code == KN_EXIT_OK) code = check(f, &r);
    if (code == KN_EXIT_OK) {
        kn_curve_say(f, "%s: %d frequencies, %.4g to %.4g Hz", c->name, r.count, r.time_s[0], r.time_s[r.count - 1]);
        code = kn_curve_finish(f, c, &r, 0, NULL);
    }
    kn_readings_free(&r);
    return code;
}
