// The results of a comparison of models as a table, a sentence and JSON.
#include "clients/identify/model_comparison.h"
#include "clients/knead/result.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

#define RUNS 3.0 // limit of kn_fit_runs, in standard deviations; residuals above the limit are not noise
// Models whose AICc differs from the best by at most this much count as equally supported (Burnham and Anderson, Model
// selection, 2.6)
#define NEAR_AICC 2
// NEAR_HELD: models whose late error is at most this many times the least one count as equally good. BELOW: the late
// stresses count as lower if their least is below this share of the least early stress.
#define NEAR_HELD 1.1
#define BELOW 0.98

int kn_model_comparison_best(const kn_model_comparison *m)
{
    int best = 0;
    for (int i = 1; i < m->rows; i++)
        if (m->row[i].aicc < m->row[best].aicc) best = i;
    return best;
}

// Return the error of the late part. Errors below KN_COMPARISON_SAME count as equal.
static double held_of(const kn_model_comparison_row *row) { return fmax(row->held, KN_COMPARISON_SAME); }

// Return the row that is best on the later part, or -1. `yardsticks`: whether laws that are no springs and dampers
// (laws.h) are included.
static int best_held(const kn_model_comparison *m, bool yardsticks)
{
    int best = -1;
    for (int i = 0; i < m->rows; i++) {
        if (m->row[i].law.yardstick && !yardsticks) continue;
        if (m->row[i].fitted && (best < 0 || held_of(&m->row[i]) < held_of(&m->row[best]))) best = i;
    }
    return best;
}

static void append(char *text, size_t size, const char *words)
{
    const size_t n = strlen(text);
    snprintf(text + n, size - n, "%s", words);
}

static void append_name(char *text, size_t size, const kn_model_comparison_row *row)
{
    char name[100];
    if (*row->law.letters) snprintf(name, sizeof name, "%s (%s)", row->law.name, row->law.letters);
    else snprintf(name, sizeof name, "%s", row->law.name);
    append(text, size, name);
}

// Return whether the row is as good as the best on the early part.
static bool describes(const kn_model_comparison *m, int i)
{
    const kn_model_comparison_row *row = &m->row[i], *best = &m->row[kn_model_comparison_best(m)];
    const bool both_fine = row->early < KN_COMPARISON_FINE && best->early < KN_COMPARISON_FINE;
    return row->fitted && (both_fine || row->aicc <= best->aicc + NEAR_AICC);
}

// Return whether the row is as good as the best on both parts.
static bool supported(const kn_model_comparison *m, int i)
{
    return describes(m, i) && held_of(&m->row[i]) <= NEAR_HELD * held_of(&m->row[best_held(m, true)]);
}

// Append the names of the rows that satisfy the condition. Return their number.
static int append_names(const kn_model_comparison *m, bool (*those)(const kn_model_comparison *m, int i), char *text,
                        size_t size)
{
    int count = 0;
    for (int i = 0; i < m->rows; i++) {
        if (!those(m, i)) continue;
        append(text, size, count++ ? ", " : "");
        append_name(text, size, &m->row[i]);
    }
    return count;
}

// Return whether the damper models fail only at stresses below all fitted stresses. At such low stresses a damper that
// depends on the stress may have another value, by a P0 above them. A model that fails only there is thus not excluded.
static bool is_below_all(const kn_model_comparison *m)
{
    bool any = false;
    for (int i = 0; i < m->rows; i++) {
        if (supported(m, i)) return false;
        any |= describes(m, i) && m->row[i].law.kind == KN_CONSTITUTIVE_DOUGH;
    }
    return any && m->relax && m->late_pa < BELOW * m->early_pa;
}

// State which rows are as good as the best on both parts. If there are none, state which are best on either part.
static void say_support(const kn_model_comparison *m, char *text, size_t size)
{
    bool any = false;
    for (int i = 0; i < m->rows; i++) any |= supported(m, i);
    if (any) {
        append(text, size, "the data support ");
        append_names(m, supported, text, size);
        append(text, size, ": best on the fitted part (AICc within 2) and on the later part (within 1.1 times)");
        return;
    }
    const int count = append_names(m, describes, text, size);
    append(text, size, count > 1 ? " describe the fitted part best, " : " describes the fitted part best, ");
    append_name(text, size, &m->row[best_held(m, true)]);
    append(text, size, is_below_all(m) ? " the later part" : " the later part: none does both");
}

// Explain that the later stresses are below the fitted ones, if that is the reason of the failure.
static void say_below(const kn_model_comparison *m, char *text, size_t size)
{
    char words[300];
    if (!is_below_all(m)) return;
    snprintf(words, sizeof words,
             ". The later stresses, down to %.3g Pa, are below all fitted ones, %.3g Pa and more: the fit has not seen "
             "the damper there, nor a P0 between them, so this does not rule out thinning; a later --cut shows more",
             m->late_pa, m->early_pa);
    append(text, size, words);
}

// If a yardstick is best on the later part, also name the best model of springs and dampers.
static void say_elements(const kn_model_comparison *m, char *text, size_t size)
{
    const int element = best_held(m, false), any = best_held(m, true);
    char words[120];
    if (element < 0 || element == any) return;
    snprintf(words, sizeof words, "; a yardstick wins; among springs and dampers, ");
    append(text, size, words);
    append_name(text, size, &m->row[element]);
    snprintf(words, sizeof words, " comes nearest, with an error of %.3g %% on the later part, against %.3g %%",
             100 * m->row[element].held, 100 * m->row[any].held);
    append(text, size, words);
}

void kn_model_comparison_verdict(const kn_model_comparison *m, char *text, size_t size)
{
    bool noise = false, known = false;
    *text = '\0';
    if (best_held(m, true) < 0) {
        append(text, size, "no model could be fitted");
        return;
    }
    say_support(m, text, size);
    say_elements(m, text, size);
    say_below(m, text, size);
    for (int i = 0; i < m->rows; i++) {
        // If the residuals of all models have long runs of one sign, no model has the shape of the data.
        known |= !isnan(m->row[i].runs);
        noise |= m->row[i].runs <= RUNS || m->row[i].early < KN_COMPARISON_FINE;
    }
    if (known && !noise)
        append(text, size,
               ". The residuals of all models have runs of one sign, unlike noise: none of them is the material");
}

void kn_model_comparison_numbers(const kn_model_comparison_row *row, char *text, size_t size)
{
    *text = '\0';
    for (int i = 0; i < row->unknowns; i++) {
        char one[80];
        const char *unit = kn_constitutive_model_unit(&row->law, i);
        snprintf(one, sizeof one, "%s%s %.3g%s%s%s", i ? ", " : "", row->unknown[i].name, row->unknown[i].value,
                 *unit ? " " : "", unit, row->loose[i] ? " (?)" : "");
        append(text, size, one);
    }
}

// Print the row of one law in the table of models.
static void print_row(const kn_model_comparison *m, const kn_model_comparison_row *row)
{
    char name[120] = "", numbers[400], runs[16] = "-";
    append_name(name, sizeof name, row);
    if (!row->fitted) {
        printf("%-42s %2d  no fit\n", name, row->unknowns);
        return;
    }
    kn_model_comparison_numbers(row, numbers, sizeof numbers);
    if (!isnan(row->runs)) snprintf(runs, sizeof runs, "%.1f", row->runs);
    printf("%-42s %2d %9.3g %9.3g %9.1f %5s  %s\n", name, row->unknowns, 100 * row->early, 100 * row->held,
           row->aicc - m->row[kn_model_comparison_best(m)].aicc, runs, numbers);
}

void kn_model_comparison_print(const kn_model_comparison *m)
{
    char text[1000];
    printf("\nmodels      fitted to %d readings up to %.4g s%s, tested on the %d after that\n", m->early, m->cut_s,
           m->relax ? " of the hold" : " of each load", m->late);
    printf("            %s\n", m->relax
                                   ? "errors: mean of |model/measured - 1|; readings are means in 20 bins per decade"
                                   : "errors: root mean square, relative to the curve's largest strain");
    printf("%-42s %2s %9s %9s %9s %5s\n", "", "n", "fitted %", "later %", "AICc", "runs");
    for (int i = 0; i < m->rows; i++) print_row(m, &m->row[i]);
    printf("letters: figure 2 of the first paper. n: parameters. AICc: difference from the best model. runs: number of "
           "sign runs,\n"
           "in standard deviations below that of noise; above 3 the model has another shape than the data. (?): not "
           "determined\n"
           "by the fitted part, at a bound or arbitrary\n");
    kn_model_comparison_verdict(m, text, sizeof text);
    printf("verdict     %s.\n", text);
}

void kn_model_comparison_tell(const kn_model_comparison *m)
{
    char text[1000];
    if (!kn_result()) return;
    for (int i = 0; i < m->rows; i++) {
        const kn_model_comparison_row *row = &m->row[i];
        json_t *to = kn_result_add("models"), *numbers = json_object();
        kn_result_text(to, "name", row->law.name);
        kn_result_text(to, "letters", row->law.letters);
        kn_result_bool(to, "yardstick", row->law.yardstick);
        kn_result_bool(to, "supported", supported(m, i));
        kn_result_number(to, "fitted_error", row->early);
        kn_result_number(to, "later_error", row->held);
        kn_result_number(to, "aicc", row->aicc);
        kn_result_number(to, "runs", row->runs);
        for (int k = 0; row->fitted && k < row->unknowns; k++)
            kn_result_number(numbers, row->unknown[k].name, row->unknown[k].value);
        json_object_set_new(to, "numbers", numbers);
        json_t *loose = json_array();
        for (int k = 0; row->fitted && k < row->unknowns; k++)
            if (row->loose[k]) json_array_append_new(loose, json_string(row->unknown[k].name));
        json_object_set_new(to, "not_known", loose);
    }
    kn_model_comparison_verdict(m, text, sizeof text);
    kn_result_text(kn_result(), "verdict", text);
    kn_result_number(kn_result(), "models_cut_s", m->cut_s);
}
