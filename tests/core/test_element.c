// Springs and dampers in series and in parallel: parsing, the paper's rules for them, and their measurable behaviour.
#include "core/element.h"
#include "core/oneport.h"
#include "tests/check.h"

static kn_element element(const char *text)
{
    kn_element e;
    char error[160];
    if (!kn_element_parse(&e, text, error, sizeof error)) KN_TEST_FAIL("%s: %s", text, error);
    return e;
}

static kn_element normal(const char *text)
{
    kn_element e = element(text);
    kn_element_normalize(&e);
    return e;
}

static kn_oneport oneport(const char *text)
{
    kn_element e = element(text);
    return kn_oneport_of(&e);
}

static void check_normal(const char *text, const char *expected)
{
    kn_element e = normal(text);
    char printed[KN_ELEMENT_TEXT];
    kn_element_print(&e, e.root, false, printed);
    CHECK_STR(printed, expected);
}

static void check_refused(const char *text, const char *expected)
{
    kn_element e;
    char error[160];
    CHECK(!kn_element_parse(&e, text, error, sizeof error));
    CHECK_STR(error, expected);
}

// List every element of n primitives, where no two equal primitives are neighbours in a group. The elements are all
// pairs of smaller elements, connected in both ways and brought to normal form. Elements that the normal form made
// smaller are left out.
typedef struct list {
    int count;
    char text[400][KN_ELEMENT_TEXT];
} list;

static void add(list *l, const char *a, char mark, const char *b, int leaves)
{
    char text[3 * KN_ELEMENT_TEXT];
    snprintf(text, sizeof text, "(%s)%c(%s)", a, mark, b);
    kn_element e = normal(text);
    if (e.leaves != leaves) return;
    kn_element_print(&e, e.root, false, text);
    for (int i = 0; i < l->count; i++)
        if (!strcmp(l->text[i], text)) return;
    memcpy(l->text[l->count++], text, KN_ELEMENT_TEXT);
}

static const list *all(int leaves)
{
    static list lists[6] = {{0}, {2, {"s", "d"}}};
    list *l = &lists[leaves];
    bool made = l->count > 0;
    for (int n = 1; !made && n <= leaves / 2; n++) {
        const list *few = all(n), *many = all(leaves - n);
        for (int i = 0; i < few->count * many->count; i++) {
            add(l, few->text[i / many->count], '-', many->text[i % many->count], leaves);
            add(l, few->text[i / many->count], '|', many->text[i % many->count], leaves);
        }
    }
    return l;
}

TEST("every spelling of an element is printed in one normal form")
{
    check_normal("(s|d)-d", "(s|d)-d");
    check_normal(" d - ( d | s ) ", "(s|d)-d");
    check_normal("s-d|s", "(s-d)|s"); // series binds tighter than parallel
    check_normal("s|s-d", "(s-d)|s");
    check_normal("s-(s-(s-d))", "s-d");
    check_normal("(s|s)-d-(s-s)", "s-d");
    check_normal("((((d))))", "d");
    check_normal("d|(s-d)|d|s|(d-s)", "(s-d)|(s-d)|s|d");
    check_normal("voigt-voigt", "(s|d)-(s|d)"); // two Voigt elements do not merge: each has its own time constant
    check_normal("kelvin-voigt", "s|d");
    check_normal("kelvin - voigt", "(s|d)-(s|d)");
    check_normal("maxwell|damper", "(s-d)|d");
    check_normal("spring-dashpot", "s-d");
    check_normal("zener", "(s-d)|s");
    check_normal("sls", "(s-d)|s");
    check_normal("jeffreys", "(s|d)-d");
    check_normal("burgers", "(s|d)-s-d");
}

TEST("an error in an expression gives the column, the fault and what was expected")
{
    check_refused("", "EXPR:1:1: ends here, expected s, d, a name like voigt, or (");
    check_refused("s|", "EXPR:1:3: ends here, expected s, d, a name like voigt, or (");
    check_refused("s||d", "EXPR:1:3: '|', expected s, d, a name like voigt, or (");
    check_refused("s-(d|s", "EXPR:1:7: not closed, expected -, | or )");
    check_refused("s-d)", "EXPR:1:4: no ( is open here, expected -, | or the end");
    check_refused("s d", "EXPR:1:3: cannot continue here, expected -, | or the end");
    check_refused("s+d", "EXPR:1:2: cannot continue here, expected -, | or the end");
    check_refused("s-dough", "EXPR:1:3: unknown element 'dough', expected s, d, a name like voigt, or (");
    check_refused("s1|d1", "EXPR:1:1: unknown element 's1', expected s, d, a name like voigt, or (");
    check_refused("voigtd", "EXPR:1:1: unknown element 'voigtd', expected s, d, a name like voigt, or (");
    check_refused("\xff", "EXPR:1:1: '\xff', expected s, d, a name like voigt, or (");
    check_refused("burgers|burgers|burgers|burgers-s", "EXPR:1:33: too many springs and dampers, expected at most 16");
    check_refused("burgers|burgers|burgers|s-burgers", "EXPR:1:27: too many springs and dampers, expected at most 16");
    char deep[KN_ELEMENT_TEXT + 1];
    memset(deep, '(', KN_ELEMENT_TEXT);
    deep[KN_ELEMENT_TEXT] = '\0';
    check_refused(deep, "EXPR:1:1: too long, expected at most 255 characters");
    deep[KN_ELEMENT_TEXT - 1] = '\0';
    check_refused(deep, "EXPR:1:256: ends here, expected s, d, a name like voigt, or (");
}

TEST("springs and dampers are numbered in order of appearance, and the largest element fits")
{
    kn_element e = element("d-(s|d)-s");
    char text[KN_ELEMENT_TEXT], name[8];
    kn_element_print(&e, e.root, true, text);
    CHECK_STR(text, "d1-(s1|d2)-s2");
    CHECK(kn_element_leaf_name(&e, 3, name));
    CHECK_STR(name, "s2");
    CHECK(!kn_element_leaf_name(&e, 4, name));
    e = element("s-(s|(s-(s|(s-(s|(s-(s|(s-(s|(s-(s|(s-(s|(s-s))))))))))))))");
    kn_element_print(&e, e.root, true, text);
    CHECK_STR(text, "s1-(s2|(s3-(s4|(s5-(s6|(s7-(s8|(s9-(s10|(s11-(s12|(s13-(s14|(s15-s16))))))))))))))");
    CHECK(kn_oneport_of(&e).parameters == 1);
}

static void letters(bool (*holds)(const kn_element *, int), char found[KN_CATALOGUE + 1])
{
    int count = 0;
    for (int i = 0; i < KN_CATALOGUE; i++) {
        kn_element e = element(kn_catalogue[i].expression);
        if (holds(&e, e.root)) found[count++] = kn_catalogue[i].letter;
    }
    found[count] = '\0';
}

static bool all_three(const kn_element *e, int node)
{
    return kn_element_residual(e, node) && kn_element_bouncing(e, node) && kn_element_vibration_dies(e, node);
}

static bool all_three_with_fewest(const kn_element *e, int node) { return all_three(e, node) && e->leaves == 3; }

TEST("the paper's rules reproduce its verdicts on figure 2, and the smallest elements that fit are (d) and (f)")
{
    char found[KN_CATALOGUE + 1];
    letters(kn_element_residual, found);
    CHECK_STR(found, "bdfghjk");
    letters(kn_element_bouncing, found);
    CHECK_STR(found, "abcdefghijk");
    letters(kn_element_vibration_dies, found);
    CHECK_STR(found, "adefgik");
    letters(all_three, found);
    CHECK_STR(found, "dfgk");
    letters(all_three_with_fewest, found);
    CHECK_STR(found, "df");
    for (int i = 0; i < KN_CATALOGUE; i++) {
        const kn_catalogue_entry *c = &kn_catalogue[i];
        kn_element e = element(c->expression);
        CHECK(kn_element_residual(&e, e.root) == c->residual);
        CHECK(kn_element_vibration_dies(&e, e.root) == c->vibration_dies);
        check_normal(c->expression, c->expression);
        // the paper's elements are sorted by size
        if (i) CHECK(e.leaves >= element(kn_catalogue[i - 1].expression).leaves);
    }
    for (int n = 2; n < 6; n++) // no element of two primitives fits
        for (int i = 0; i < all(n)->count; i++) {
            kn_element e = element(all(n)->text[i]);
            if (all_three(&e, e.root)) CHECK(n >= 3);
        }
}

// Count the elements of n primitives that share an entry's verdicts and have as many parameters as primitives.
static int candidates(const kn_catalogue_entry *c, int n, bool *own)
{
    int count = 0;
    for (int i = 0; i < all(n)->count; i++) {
        kn_element e = element(all(n)->text[i]);
        if (kn_oneport_of(&e).parameters < n || !kn_element_bouncing(&e, e.root)) continue;
        if (kn_element_residual(&e, e.root) != c->residual) continue;
        if (kn_element_vibration_dies(&e, e.root) != c->vibration_dies) continue;
        count++;
        *own |= !strcmp(all(n)->text[i], c->expression);
        if (c->provenance != KN_PROVENANCE_FORCED && strcmp(all(n)->text[i], c->expression))
            CHECK(strstr(c->because, all(n)->text[i]) != NULL); // the catalogue names the other candidates
    }
    return count;
}

TEST("the catalogue's forced and reconstructed entries match a search of all networks of the same size")
{
    CHECK(all(2)->count == 2);
    CHECK(all(3)->count == 4);
    CHECK(all(4)->count == 12);
    int irreducible = 0;
    for (int i = 0; i < 12; i++) irreducible += oneport(all(4)->text[i]).parameters == 4;
    CHECK(irreducible == 8); // Normand and Peleg count as many arrangements of two springs and two dashpots
    for (int i = 0; i < KN_CATALOGUE; i++) {
        const kn_catalogue_entry *c = &kn_catalogue[i];
        bool own = false;
        int leaves = element(c->expression).leaves, count = candidates(c, leaves, &own);
        CHECK(own);
        if (c->provenance == KN_PROVENANCE_PAIR) CHECK(count == 2);
        else if (c->provenance == KN_PROVENANCE_GUESS) CHECK(count == 4);
        else CHECK(count == (c->residual && c->vibration_dies ? 2 : 1)); // (d) and (f): figure 3 tells them apart
    }
}

TEST("figure 2 holds six one-ports: c = e, d = f, g = h = j = k")
{
    static const char *const same[6] = {"a", "b", "ce", "df", "ghjk", "i"};
    for (int i = 0; i < KN_CATALOGUE; i++)
        for (int k = 0; k < KN_CATALOGUE; k++) {
            kn_oneport a = oneport(kn_catalogue[i].expression), b = oneport(kn_catalogue[k].expression);
            bool expected = false;
            for (int s = 0; s < 6; s++)
                expected |= strchr(same[s], kn_catalogue[i].letter) && strchr(same[s], kn_catalogue[k].letter);
            CHECK(kn_oneport_equal(&a, &b) == expected);
        }
    kn_oneport guess = oneport(kn_catalogue[8].expression);
    for (int i = 0; i < all(4)->count; i++) // all candidates for (i) are the same one-port
        if (strstr(kn_catalogue[8].because, all(4)->text[i])) {
            kn_oneport other = oneport(all(4)->text[i]);
            CHECK(kn_oneport_equal(&guess, &other));
        }
}

TEST(
    "in every element of up to five primitives, fluid equals the paper's residual, and the class counts the parameters")
{
    for (int n = 1; n < 6; n++)
        for (int i = 0; i < all(n)->count; i++) {
            kn_element e = element(all(n)->text[i]);
            kn_oneport o = kn_oneport_of(&e);
            CHECK(o.fluid == kn_element_residual(&e, e.root));
            CHECK(o.degree_n - o.degree_d == !o.elastic);
            int dimension = !o.fluid + !o.elastic + 2 * o.relaxation; // dimension of the Prony form
            if (o.parameters != dimension) KN_TEST_FAIL("%s: %d, not %d", all(n)->text[i], o.parameters, dimension);
            CHECK(dimension == o.elastic + o.fluid + 2 * o.retardation); // dimension of the series of Voigt units
            CHECK(o.parameters <= n);
        }
    printf("     %d elements of five primitives\n", all(5)->count);
}

TEST("every element equals its Voigt series and its parallel Maxwell units, and both have the fewest primitives")
{
    for (int n = 1; n < 6; n++)
        for (int i = 0; i < all(n)->count; i++) {
            kn_oneport o = oneport(all(n)->text[i]);
            char text[2][KN_ELEMENT_TEXT];
            kn_oneport_maxwell(&o, text[0]);
            kn_oneport_voigt(&o, text[1]);
            for (int form = 0; form < 2; form++) {
                kn_oneport canonical = oneport(text[form]);
                CHECK(kn_oneport_equal(&o, &canonical));
                CHECK(canonical.parameters == o.parameters);
                CHECK(element(text[form]).leaves == o.parameters);
                check_normal(text[form], text[form]);
            }
        }
}

TEST("both forms of the standard linear solid have one complex modulus after re-mapping the parameters")
{
    kn_element zener = element("s|(s-d)"), kelvin = element("s-(s|d)");
    double a[3] = {1e4, 3e4, 2e3}, b[3], g = a[0] + a[1]; // g: modulus of both springs in parallel
    b[0] = g;
    b[1] = a[0] * g / a[1];
    b[2] = a[2] * g * g / (a[1] * a[1]);
    for (double omega = 1e-3; omega < 1e5; omega *= 10) {
        double one[2], two[2];
        kn_oneport_modulus(&zener, zener.root, a, omega, &one[0], &one[1]);
        kn_oneport_modulus(&kelvin, kelvin.root, b, omega, &two[0], &two[1]);
        CHECK_NEAR(two[0], one[0], 1e-12 * one[0]);
        CHECK_NEAR(two[1], one[1], 1e-9 * one[1]);
    }
    double storage, loss;
    kn_oneport_modulus(&zener, zener.root, a, 1 / (a[2] / a[1]), &storage,
                       &loss); // omega tau = 1: G' = ke + k1/2, G'' = k1/2
    CHECK_NEAR(storage, 2.5e4, 1e-9);
    CHECK_NEAR(loss, 1.5e4, 1e-9);
}

TESTS_MAIN
