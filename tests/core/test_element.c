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
    // series binds tighter than parallel; two Voigt elements do not merge, since each has its own time constant
    const char *spelling = "(s|d)-d=(s|d)-d; d - ( d | s ) =(s|d)-d;s-d|s=(s-d)|s;s|s-d=(s-d)|s;s-(s-(s-d))=s-d;"
                           "(s|s)-d-(s-s)=s-d;((((d))))=d;d|(s-d)|d|s|(d-s)=(s-d)|(s-d)|s|d;voigt-voigt=(s|d)-(s|d);"
                           "kelvin-voigt=s|d;kelvin - voigt=(s|d)-(s|d);maxwell|damper=(s-d)|d;spring-dashpot=s-d;"
                           "zener=(s-d)|s;sls=(s-d)|s;jeffreys=(s|d)-d;burgers=(s|d)-s-d;";
    char text[40], expected[40];
    int count = 0, size;
    for (; sscanf(spelling, "%39[^=]=%39[^;];%n", text, expected, &size) == 2; spelling += size, count++)
        check_normal(text, expected);
    CHECK(count == 17);
}

TEST("an error in an expression gives the column, the fault and what was expected")
{
    char deep[2][KN_ELEMENT_TEXT + 1], error[160]; // one character too long, and just not
    memset(deep, '(', sizeof deep);
    deep[0][KN_ELEMENT_TEXT] = deep[1][KN_ELEMENT_TEXT - 1] = '\0';
#define PRIMITIVE "expected s, d, a name like voigt, or ("
    const char *const bad[][2] = {
        {"", "1: ends here, " PRIMITIVE},
        {"s|", "3: ends here, " PRIMITIVE},
        {"s||d", "3: '|', " PRIMITIVE},
        {"s-(d|s", "7: not closed, expected -, | or )"},
        {"s-d)", "4: no ( is open here, expected -, | or the end"},
        {"s d", "3: cannot continue here, expected -, | or the end"},
        {"s+d", "2: cannot continue here, expected -, | or the end"},
        {"s-dough", "3: unknown element 'dough', " PRIMITIVE},
        {"s1|d1", "1: unknown element 's1', " PRIMITIVE},
        {"voigtd", "1: unknown element 'voigtd', " PRIMITIVE},
        {"\xff", "1: '\xff', " PRIMITIVE},
        {"burgers|burgers|burgers|burgers-s", "33: too many springs and dampers, expected at most 16"},
        {"burgers|burgers|burgers|s-burgers", "27: too many springs and dampers, expected at most 16"},
        {deep[0], "1: too long, expected at most 255 characters"},
        {deep[1], "256: ends here, " PRIMITIVE},
    };
    for (int i = 0; i < COUNT(bad); i++) {
        kn_element e;
        CHECK(!kn_element_parse(&e, bad[i][0], error, sizeof error) && strncmp(error, "EXPR:1:", 7) == 0);
        CHECK_STR(error + 7, bad[i][1]);
    }
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

static bool all_three(const kn_element *e, int node)
{
    return kn_element_residual(e, node) && kn_element_bouncing(e, node) && kn_element_vibration_dies(e, node);
}

static bool all_three_with_fewest(const kn_element *e, int node) { return all_three(e, node) && e->leaves == 3; }

TEST("the paper's rules reproduce its verdicts on figure 2, and the smallest elements that fit are (d) and (f)")
{
    static const struct {
        bool (*holds)(const kn_element *, int);
        const char *letters;
    } rules[] = {{kn_element_residual, "bdfghjk"},
                 {kn_element_bouncing, "abcdefghijk"},
                 {kn_element_vibration_dies, "adefgik"},
                 {all_three, "dfgk"},
                 {all_three_with_fewest, "df"}};
    for (int i = 0; i < KN_CATALOGUE; i++) {
        const kn_catalogue_entry *c = &kn_catalogue[i];
        kn_element e = element(c->expression);
        for (int r = 0; r < COUNT(rules); r++)
            CHECK(rules[r].holds(&e, e.root) == (strchr(rules[r].letters, c->letter) != NULL));
        CHECK(kn_element_residual(&e, e.root) == c->residual);
        CHECK(kn_element_vibration_dies(&e, e.root) == c->vibration_dies);
        check_normal(c->expression, c->expression);
        // the paper's elements are sorted by size
        if (i) CHECK(e.leaves >= element(kn_catalogue[i - 1].expression).leaves);
    }
    for (int i = 0; i < all(2)->count; i++) { // no element of two primitives fits
        kn_element e = element(all(2)->text[i]);
        CHECK(!all_three(&e, e.root));
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
