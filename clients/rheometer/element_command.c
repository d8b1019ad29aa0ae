// knead element: explains what a network of springs and dampers does by the first paper's rules, and which of its
// properties can be measured. The rules are in core/element.h, the mechanics in core/oneport.h. This file prints them
// in words.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "core/oneport.h"
#include "server/option_table.h"
#include <stdio.h>
#include <string.h>

static const char usage[] =
    "usage: knead element EXPR\n"
    "       knead element --catalogue\n\n"
    "Analyse an element of springs and dampers, with reasons. The output begins with the verdicts of the first\n"
    "paper's rules on residual deformation, bouncing and vibration. The impedance between the two ends follows, with\n"
    "its limits at low and at high frequency. Last come the number of parameters that can be identified, and the\n"
    "elements with the same response. To test an element on the virtual rheometer, use knead creep, relax and "
    "sweep.\n\n"
    "  EXPR              springs s and dampers d in series (-) or in parallel (|). The sign - binds tighter;\n"
    "                    parentheses group. Names can be parts: burgers s-d-(s|d), jeffreys (s|d)-d, maxwell s-d,\n"
    "                    voigt (kelvin, kelvin-voigt) s|d, zener (sls) (s-d)|s, spring s, damper (dashpot) d. A\n"
    "                    wrong EXPR is reported in one line, EXPR:1:col: what is wrong, what was expected\n"
    "  --catalogue       list the eleven elements of the first paper's figure 2\n\n"
    "Examples:\n"
    "    knead element '(s|d)-d'\n"
    "    knead element 'maxwell|maxwell'\n"
    "    knead element --catalogue\n\n"
    "Exit codes: 0 ok, 2 bad input.\n";

// Parse the text of an element that is known to be valid.
static kn_element element_of(const char *text)
{
    kn_element e;
    char error[160];
    // No error can occur, because the texts are constants of this program or printed by it.
    kn_element_parse(&e, text, error, sizeof error);
    return e;
}

static kn_oneport oneport_of(const char *text)
{
    kn_element e = element_of(text);
    return kn_oneport_of(&e);
}

// Print the members of a series or parallel group for which the function `holds` returns `wanted`, separated by commas.
static void list_parts(const kn_element *e, int node, bool (*holds)(const kn_element *, int), bool wanted)
{
    const kn_element_node *g = &e->node[node];
    char text[KN_ELEMENT_TEXT];
    const char *comma = "";
    for (int i = 0; i < g->count; i++) {
        if (holds(e, g->child[i]) != wanted) continue;
        kn_element_print(e, g->child[i], false, text);
        printf("%s%s", comma, text);
        comma = ", ";
    }
}

// Print one line for each group: whether a residual deformation remains, the rule, and the parts that decide the
// verdict.
static void explain_residual(const kn_element *e, int node)
{
    const kn_element_node *g = &e->node[node];
    char text[KN_ELEMENT_TEXT];
    kn_element_print(e, node, false, text);
    bool yes = kn_element_residual(e, node);
    printf("            %-12s %s", text, yes ? "yes, " : "no, ");
    if (g->kind == KN_ELEMENT_SPRING) printf("a spring recovers\n");
    else if (g->kind == KN_ELEMENT_DAMPER) printf("a damper keeps its deformation\n");
    // A part either keeps a residual deformation or recovers. In a series, one part with residual deformation decides
    // the verdict. In a parallel group, one part that recovers decides the verdict.
    else if (yes == (g->kind == KN_ELEMENT_SERIES)) {
        printf(yes ? "in series, one part with residual deformation is enough (Table 1a): "
                   : "in parallel, one part that recovers is enough (Table 1b): ");
        list_parts(e, node, kn_element_residual, yes);
        printf("\n");
    } else
        printf(yes ? "in parallel, and all parts have residual deformation (Table 1b)\n"
                   : "in series, and all parts recover (Table 1a)\n");
    // Explain the groups of parts inside this group. Single springs and dampers need no explanation.
    for (int i = 0; i < g->count; i++)
        if (e->node[g->child[i]].kind >= KN_ELEMENT_SERIES) explain_residual(e, g->child[i]);
}

static bool has_damper(const kn_element *e, int node) { return kn_element_count(e, node, KN_ELEMENT_DAMPER) > 0; }

// Print the parts of the element from which the vibration rule concludes whether a vibration decays.
static void explain_vibration(const kn_element *e)
{
    // The vibration rule concerns the parts of a series. An element that is not a series is treated as a series of one
    // part.
    if (e->node[e->root].kind != KN_ELEMENT_SERIES) {
        printf("            the element is a single part, %s a damper\n", has_damper(e, e->root) ? "with" : "without");
        return;
    }
    bool dies = kn_element_vibration_dies(e, e->root);
    printf("            %s: ", dies ? "every part of the series has a damper" : "parts of the series without a damper");
    list_parts(e, e->root, has_damper, dies);
    printf("\n");
}

// Print the verdicts of the rules on an element, and the properties that follow from them.
static void print_rules(const kn_element *e)
{
    bool residual = kn_element_residual(e, e->root), bouncing = kn_element_bouncing(e, e->root);
    bool dies = kn_element_vibration_dies(e, e->root);
    int springs = kn_element_count(e, e->root, KN_ELEMENT_SPRING);
    printf("\nby the first paper's rules, section 3.1\n");
    printf("residual    %s\n", residual ? "yes: part of the deformation remains" : "no: all deformation recovers");
    explain_residual(e, e->root);
    printf("bouncing    %s\n", bouncing ? "yes: deformation recovers, at least in part" : "no: nothing recovers");
    if (bouncing) printf("            one spring anywhere is enough (Table 2): the element has %d\n", springs);
    else printf("            the element has no spring (Table 2)\n");
    printf("vibration   %s\n", dies ? "decreases" : "remains");
    explain_vibration(e);
    printf("verdict     ");
    // A rheological object has residual deformation, bouncing and decaying vibration. Name the properties that are
    // missing.
    if (residual && bouncing && dies) printf("has all three properties of a rheological object\n");
    else
        printf("not rheological: %s%s%s%s%s\n", residual ? "" : "no residual deformation",
               !residual && !bouncing ? ", " : "", bouncing ? "" : "no bouncing",
               !dies && !(residual && bouncing) ? ", " : "", dies ? "" : "vibration remains");
}

// Print a polynomial like "b0 + b1 p + b2 p^2", beginning with the term of degree `from`. The coefficient a0 of a
// denominator is always 1.
static void print_polynomial(char letter, int from, int degree)
{
    bool brackets = degree > from;
    if (brackets) printf("(");
    for (int i = from; i <= degree; i++) {
        if (i > from) printf(" + ");
        if (i > 0 || letter == 'b') printf("%c%d", letter, i);
        else printf("1");
        if (i > 0) printf(i > 1 ? " p^%d" : " p", i);
    }
    if (brackets) printf(")");
}

// Print the impedance Z(p) between the two ends of the element, and its limits at low and high frequency.
static void print_impedance(const kn_oneport *o)
{
    printf("impedance   Z(p) = ");
    print_polynomial('b', o->fluid, o->degree_n);
    if (o->degree_d > 0) printf(" / ");
    if (o->degree_d > 0) print_polynomial('a', 0, o->degree_d);
    printf(", stress over strain, p = d/dt\n");
    printf("long term   %s\n", o->fluid
                                   ? "fluid: Z(0) = 0, it flows under any constant load, and this deformation remains"
                                   : "solid: Z(0) > 0, a constant load leads to a final strain, which recovers");
    // Print whether the element responds to a fast change like a spring or like a dashpot.
    printf("instant     %s\n",
           o->elastic ? "spring: Z stays finite for fast changes; a step of strain needs a finite stress"
                      : "dashpot: Z grows with p; no step of strain is possible, and a fast probe feels the damping c");
}

// Print the class of elements that have the same impedance, by its two canonical forms (Maxwell, Voigt).
static void print_class(const kn_oneport *o)
{
    char maxwell[KN_ELEMENT_TEXT], voigt[KN_ELEMENT_TEXT], letters[3 * KN_CATALOGUE + 1] = "";
    const char *name = kn_oneport_name(o);
    kn_oneport_maxwell(o, maxwell);
    kn_oneport_voigt(o, voigt);
    printf("class       %s%s%d time%s of relaxation, %d of creep\n", name ? name : "", name ? ": " : "", o->relaxation,
           o->relaxation == 1 ? "" : "s", o->retardation);
    printf("            as Maxwell units side by side %s, as Voigt units in a row %s\n", maxwell, voigt);
    // Find the elements in figure 2 of the first paper that have the same impedance as this element.
    for (int i = 0; i < KN_CATALOGUE; i++) {
        kn_oneport other = oneport_of(kn_catalogue[i].expression);
        size_t at = strlen(letters);
        if (kn_oneport_equal(o, &other)) snprintf(letters + at, sizeof letters - at, " %c", kn_catalogue[i].letter);
    }
    if (*letters)
        printf("            in the paper's figure 2:%s; no experiment at the two ends tells these elements apart\n",
               letters);
}

// Print whether a mass on the element vibrates. The verdict follows from mechanics and not from the vibration rule. The
// vibration rule depends on how the element is drawn: another drawing with the same impedance may get the other
// verdict.
static void print_vibration(const kn_element *e, const kn_oneport *o)
{
    char maxwell[KN_ELEMENT_TEXT], voigt[KN_ELEMENT_TEXT];
    kn_oneport_maxwell(o, maxwell);
    kn_oneport_voigt(o, voigt);
    bool dies = kn_element_vibration_dies(e, e->root);
    const char *other = NULL;
    // Apply the vibration rule to the two canonical forms and check if the verdicts contradict each other.
    kn_element m = element_of(maxwell), v = element_of(voigt);
    if (kn_element_vibration_dies(&m, m.root) != dies) other = maxwell;
    if (kn_element_vibration_dies(&v, v.root) != dies) other = voigt;
    printf("vibration   ");
    if (!has_damper(e, e->root)) printf("a mass on the element swings for ever\n");
    else if (o->elastic)
        printf("a mass on the element comes to rest; a light mass rings first, since the loss falls as 1/frequency\n");
    else printf("a mass on the element comes to rest; a light mass does not ring, since the dashpot brakes it\n");
    if (other)
        printf("            the rule says \"%s\" here and \"%s\" for %s, which is the same one-port: "
               "the rule depends on the drawing\n",
               dies ? "decreases" : "remains", dies ? "remains" : "decreases", other);
}

// Print the properties of the element that can be measured at its two ends.
static void print_oneport(const kn_element *e)
{
    kn_oneport o = kn_oneport_of(e);
    printf("\nbetween its two ends\n");
    print_impedance(&o);
    printf("parameters  %d of %d can be identified%s\n", o.parameters, e->leaves,
           o.parameters < e->leaves ? ": the element has more parts than its response shows" : "");
    print_class(&o);
    print_vibration(e, &o);
}

// Print the rules and the measurable properties for one expression. Return an exit code.
static int explain(const char *text)
{
    kn_element e;
    char error[160], printed[KN_ELEMENT_TEXT];
    if (!kn_element_parse(&e, text, error, sizeof error)) return kn_complain("element", KN_EXIT_USAGE, "%s", error);
    // Convert the element to its normal form, so that it can be compared with the catalogue.
    kn_element_normalize(&e);
    kn_element_print(&e, e.root, false, printed);
    int springs = kn_element_count(&e, e.root, KN_ELEMENT_SPRING), dampers = e.leaves - springs;
    const char *name = kn_element_name(&e);
    printf("element     %s", printed);
    if (name && strcmp(name, printed)) printf(", %s", name);
    printf(": %d spring%s, %d damper%s", springs, springs == 1 ? "" : "s", dampers, dampers == 1 ? "" : "s");
    for (int i = 0; i < KN_CATALOGUE; i++)
        if (!strcmp(kn_catalogue[i].expression, printed))
            printf("; figure 2 (%c)%s", kn_catalogue[i].letter,
                   kn_catalogue[i].provenance == KN_PROVENANCE_FORCED ? "" : ", reconstructed");
    printf("\n");
    print_rules(&e);
    print_oneport(&e);
    return KN_EXIT_OK;
}

static void print_catalogue(void)
{
    static const char *const provenance[] = {"forced", "one of 2", "one of 4"};
    printf(
        "Figure 2 of the first paper. Its drawings are lost, so the elements are chosen to fit the paper's verdicts.\n"
        "forced: no other element of this size fits, or another figure shows the element.\n"
        "one of 2, one of 4: this many elements fit, and one of them was chosen.\n\n"
        "    element        residual  bouncing  vibration  all three  one-port               the text leaves\n");
    for (int i = 0; i < KN_CATALOGUE; i++) {
        const kn_catalogue_entry *c = &kn_catalogue[i];
        kn_element e = element_of(c->expression);
        kn_oneport o = kn_oneport_of(&e);
        bool residual = kn_element_residual(&e, e.root), dies = kn_element_vibration_dies(&e, e.root);
        const char *name = kn_oneport_name(&o);
        bool bouncing = kn_element_bouncing(&e, e.root);
        printf("(%c) %-14s %-9s %-9s %-10s %-10s %-22s %s: %s\n", c->letter, c->expression, residual ? "yes" : "no",
               bouncing ? "yes" : "no", dies ? "decreases" : "remains", residual && bouncing && dies ? "yes" : "no",
               name ? name : "(solid of four)", provenance[c->provenance], c->because);
    }
    printf(
        "\nAll three properties with the fewest parts: (d) and (f). Both are the same one-port; the paper takes (d).\n"
        "Entries with the same one-port differ in their drawing, not in their response: figure 2 holds six one-ports.\n"
        "But the vibration rule separates entries with the same one-port: (c) from (e), and (h), (j) from (g), (k).\n"
        "Redundant elements, like ((s-d)|d)-d, are left out: they have one parameter too many.\n");
}

int kn_element_main(int argc, char **argv)
{
    static const kn_option rows[] = {KN_OPTION("catalogue", FLAG, .offset = 0)};
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = usage};
    bool catalogue = false;
    const int code = kn_options_read(&table, &catalogue, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (argc - optind != !catalogue)
        return kn_complain("element", KN_EXIT_USAGE,
                           "expected one expression like '(s|d)-d', or --catalogue; see --help");
    if (!catalogue) return explain(argv[optind]);
    print_catalogue();
    return KN_EXIT_OK;
}
