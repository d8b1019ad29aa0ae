#ifndef KN_CORE_ELEMENT_H
#define KN_CORE_ELEMENT_H
// Rheological elements: springs and dampers connected in series and in parallel, written as text.
//
//     expression = series { "|" series }      side by side: same strain, the stresses add up
//     series     = unit { "-" unit }          in a row: same stress, the strains add up; "-" binds tighter than "|"
//     unit       = "s" | "d" | name | "(" expression ")"
//
//                +---s---+
//     (s|d)-d :  o       o---d---o            s-d|s is (s-d)|s, a Maxwell unit beside a spring
//                +---d---+
//
// Names stand for what they are called in the field; where it knows two forms, this is the one meant:
//     spring s   damper dashpot d   voigt kelvin kelvin-voigt s|d   maxwell s-d   zener sls (s-d)|s (the standard
//     linear solid; its other form, (s|d)-s, is the same one-port)   jeffreys (s|d)-d (the papers' element; other form
//     (s-d)|d) burgers s-d-(s|d)
//
// The rules by which the first paper chooses its element (Tomokuni, Sugiyama, Hirai: construction of virtual
// rheological objects, section 3.1, Tables 1 and 2) are inferences over this tree:
//                      spring   damper   in series   in parallel
//     residual         no       yes      either      both            something stays
//     bouncing         yes      no       either      either          something comes back
//     vibration decreases: "one rheological element can be regarded as a series of some parts", a part being what has
//     one displacement; it does when every part involves a damper.
// The first two are properties of what can be measured at the two ends. The third is not: core/oneport.h.
#include <stdbool.h>
#include <stddef.h>

#define KN_ELEMENT_MAX 16   // springs and dampers of one element
#define KN_ELEMENT_TEXT 256 // bytes of an expression with the NUL

typedef enum kn_element_kind {
    KN_ELEMENT_SPRING,
    KN_ELEMENT_DAMPER,
    KN_ELEMENT_SERIES,
    KN_ELEMENT_PARALLEL
} kn_element_kind;

typedef struct kn_element_node {
    kn_element_kind kind;
    int leaf;                            // SPRING, DAMPER: number of this primitive in order of appearance, from 0
    int count;                           // SERIES, PARALLEL: children, >= 2, none of them of the same kind
    unsigned char child[KN_ELEMENT_MAX]; // node numbers
} kn_element_node;

typedef struct kn_element {
    int leaves; // springs and dampers
    int nodes;
    int root;
    kn_element_node node[2 * KN_ELEMENT_MAX];
} kn_element;

// Reads an expression, groups within groups of the same kind taken apart ("s-(s-d)" is s-s-d). False and one line in
// error, "EXPR:1:col: what is wrong, what was expected".
bool kn_element_parse(kn_element *e, const char *text, char *error, size_t error_size);

// The same element as every equal one is written: of springs (of dampers) beside each other in one group one is left,
// then groups stand before s before d. Two elements are equal but for order and such repetition when their texts are.
void kn_element_normalize(kn_element *e);

// The text of the tree under a node (e->root for all), with no more parentheses than needed and around every group in a
// group. numbered: s1, s2, d1 .. in order of appearance, the names of its parameters.
void kn_element_print(const kn_element *e, int node, bool numbered, char text[KN_ELEMENT_TEXT]);

// "s2", "d1": how the primitive of that number is called. False beyond the last one.
bool kn_element_leaf_name(const kn_element *e, int leaf, char name[8]);

int kn_element_count(const kn_element *e, int node, kn_element_kind kind); // springs or dampers under a node

// What the field calls an expression that is one of the names above in normal form, else NULL.
const char *kn_element_name(const kn_element *normal);

// The paper's rules, of the tree under a node.
bool kn_element_residual(const kn_element *e, int node);
bool kn_element_bouncing(const kn_element *e, int node);
bool kn_element_vibration_dies(const kn_element *e, int node);

// Figure 2 of the paper, (a) to (k). The drawings are lost; what its text says of each is left.
typedef enum kn_provenance {
    KN_PROVENANCE_FORCED, // the only element of its size with the text's verdicts
    KN_PROVENANCE_PAIR,   // one of two with these verdicts; the text forces the pair, the order is a reconstruction
    KN_PROVENANCE_GUESS   // one of four with these verdicts, all of them the same one-port
} kn_provenance;

typedef struct kn_catalogue_entry {
    char letter;
    const char *expression;        // normal form
    bool residual, vibration_dies; // as the paper states them; all of them bounce
    kn_provenance provenance;
    const char *because;
} kn_catalogue_entry;

#define KN_CATALOGUE 11
extern const kn_catalogue_entry kn_catalogue[KN_CATALOGUE];

#endif
