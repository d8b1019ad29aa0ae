// What a comparison of models has found, in a table, a sentence and JSON.
#include "clients/identify/models.h"
#include "clients/knead/result.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

#define RUNS 3.0    // standard deviations of kn_fit_runs from which residuals are not noise
#define NEAR_AICC 2 // of the best: as well supported (Burnham and Anderson, Model selection, 2.6)
#define NEAR_HELD 1.1
#define EXACT 1e-4 // a misfit that averages leave of a perfect curve

int kn_models_best(const kn_models *m)
{
    int best = 0;
    for (int i = 1; i < m->rows; i++)
        if (m->row[i].aicc < m->row[best].aicc) best = i;
    return best;
}

static int best_held(const kn_models *m, bool yardsticks)
{
    int best = -1;
    for (int i = 0; i < m->rows; i++) {
        if (m->row[i].law.yardstick && !yardsticks) continue;
        if (m->row[i].fitted && (best < 0 || m->row[i].held < m->row[best].held)) best = i;
    }
    return best;
}

static void append(char *text, size_t size, const char *words)
{
    const size_t n = strlen(text);
    snprintf(text + n, size - n, "%s", words);
}

static void append_name(char *text, size_t size, const kn_models_row *row)
{
    char name[100];
    if (*row->law.letters)
        snprintf(name, sizeof name, "%s (%s)", row->law.name, row->law.letters);
    else
        snprintf(name, sizeof name, "%s", row->law.name);
    append(text, size, name);
}

static bool supported(const kn_models *m, int i)
{
    const kn_models_row *row = &m->row[i];
    const double held = m->row[best_held(m, true)].held;
    return row->fitted && row->aicc <= m->row[kn_models_best(m)].aicc + NEAR_AICC && row->held <= NEAR_HELD * held;
}

// Who is as good as the best on both parts; and where that is no one, who is best on which.
static void say_support(const kn_models *m, char *text, size_t size)
{
    int count = 0;
    for (int i = 0; i < m->rows; i++) {
        if (!supported(m, i)) continue;
        append(text, size, count++ ? ", " : "the data support ");
        append_name(text, size, &m->row[i]);
    }
    if (count) {
        append(text, size, ": best on what was fitted (AICc within 2) and on what came later (within 1.1 times)");
        return;
    }
    append_name(text, size, &m->row[kn_models_best(m)]);
    append(text, size, " describes best what was fitted, ");
    append_name(text, size, &m->row[best_held(m, true)]);
    append(text, size, " what came later: none does both");
}

static void say_elements(const kn_models *m, char *text, size_t size)
{
    const int element = best_held(m, false), any = best_held(m, true);
    char words[120];
    if (element < 0 || element == any) return;
    snprintf(words, sizeof words, "; a yardstick wins, of springs and dampers ");
    append(text, size, words);
    append_name(text, size, &m->row[element]);
    snprintf(words, sizeof words, " comes nearest, %.3g %% on what came later, against %.3g %%",
             100 * m->row[element].held, 100 * m->row[any].held);
    append(text, size, words);
}

void kn_models_verdict(const kn_models *m, char *text, size_t size)
{
    bool noise = false, known = false;
    *text = '\0';
    if (best_held(m, true) < 0) {
        append(text, size, "no model could be fitted");
        return;
    }
    say_support(m, text, size);
    say_elements(m, text, size);
    for (int i = 0; i < m->rows; i++) {
        known |= !isnan(m->row[i].runs);
        noise |= m->row[i].runs <= RUNS || m->row[i].early < EXACT;
    }
    if (known && !noise)
        append(text, size,
               ". All leave residuals in runs of one sign, which noise does not: none of them is the "
               "material");
}

void kn_models_numbers(const kn_models_row *row, char *text, size_t size)
{
    *text = '\0';
    for (int i = 0; i < row->unknowns; i++) {
        char one[80];
        const char *unit = kn_law_unit(&row->law, i);
        snprintf(one, sizeof one, "%s%s %.3g%s%s", i ? ", " : "", row->unknown[i].name, row->unknown[i].value,
                 *unit ? " " : "", unit);
        append(text, size, one);
    }
}

static void print_row(const kn_models *m, const kn_models_row *row)
{
    char name[120] = "", numbers[400], runs[16] = "-";
    append_name(name, sizeof name, row);
    if (!row->fitted) {
        printf("%-42s %2d  no answer\n", name, row->unknowns);
        return;
    }
    kn_models_numbers(row, numbers, sizeof numbers);
    if (!isnan(row->runs)) snprintf(runs, sizeof runs, "%.1f", row->runs);
    printf("%-42s %2d %9.3g %9.3g %9.1f %5s  %s\n", name, row->unknowns, 100 * row->early, 100 * row->held,
           row->aicc - m->row[kn_models_best(m)].aicc, runs, numbers);
}

void kn_models_print(const kn_models *m)
{
    char text[1000];
    printf("\nmodels      fitted to %d readings up to %.4g s%s, judged by the %d after that\n", m->early, m->cut_s,
           m->relax ? " of the hold" : " of each load", m->late);
    printf("            %s\n", m->relax ? "errors: mean of |model/measured - 1|; readings are means in 20 bins a decade"
                                        : "errors: root mean square, of the curve's largest strain");
    printf("%-42s %2s %9s %9s %9s %5s\n", "", "n", "fitted %", "later %", "AICc", "runs");
    for (int i = 0; i < m->rows; i++) print_row(m, &m->row[i]);
    printf(
        "letters: figure 2 of the first paper. n: numbers fitted. AICc: above the best one's. runs: of residuals, in\n"
        "standard deviations of noise; above 3 the model bends otherwise than the data\n");
    kn_models_verdict(m, text, sizeof text);
    printf("verdict     %s.\n", text);
}

void kn_models_tell(const kn_models *m)
{
    char text[1000];
    if (!kn_result()) return;
    for (int i = 0; i < m->rows; i++) {
        const kn_models_row *row = &m->row[i];
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
    }
    kn_models_verdict(m, text, sizeof text);
    kn_result_text(kn_result(), "verdict", text);
    kn_result_number(kn_result(), "models_cut_s", m->cut_s);
}
