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
// Names are those of the literature. Where the literature uses a name for two elements, it means the one listed here:
//     spring s   damper dashpot d   voigt kelvin kelvin-voigt s|d   maxwell s-d   zener sls (s-d)|s (the standard
//     linear solid; its other form, (s|d)-s, is the same one-port)   jeffreys (s|d)-d (the papers' element; other form
//     (s-d)|d) burgers s-d-(s|d)
//
// The first paper that this project follows chooses its element by rules (Tomokuni, Sugiyama, Hirai: construction of
// virtual rheological objects, section 3.1, Tables 1 and 2). The rules are inferences over this tree:
//                      spring   damper   in series   in parallel
//     residual         no       yes      either      both            a part of the deformation stays
//     bouncing         yes      no       either      either          a part of the deformation comes back
//     vibration decreases: "one rheological element can be regarded as a series of some parts"; a part is a piece with
//     one displacement. Vibration decreases if every part involves a damper.
// The first two properties can be measured at the two ends of an element. The third cannot: see core/oneport.h. An
// element is plain data; no function allocates.
#include <stdbool.h>
#include <stddef.h>

#define KN_ELEMENT_MAX 16   // largest number of springs and dampers of one element
#define KN_ELEMENT_TEXT 256 // size of a buffer for an expression, NUL included [bytes]

typedef enum kn_element_kind {
    KN_ELEMENT_SPRING,
    KN_ELEMENT_DAMPER,
    KN_ELEMENT_SERIES,
    KN_ELEMENT_PARALLEL
} kn_element_kind;

typedef struct kn_element_node {
    kn_element_kind kind;
    int leaf;  // SPRING, DAMPER: index of the spring or damper in the order of the text, from 0
    int count; // SERIES, PARALLEL: number of children, >= 2; no child is of the same kind as its parent
    unsigned char child[KN_ELEMENT_MAX]; // children, as indices in kn_element.node
} kn_element_node;

typedef struct kn_element {
    int leaves; // number of springs and dampers
    int nodes;  // number of nodes of the tree
    int root;   // index of the topmost node
    kn_element_node node[2 * KN_ELEMENT_MAX];
} kn_element;

// Read an expression. A group within a group of the same kind is dissolved ("s-(s-d)" is s-s-d). Return false if the
// text is no expression. Then error[error_size] holds one line, "EXPR:1:col: what is wrong, what was expected".
bool kn_element_parse(kn_element *e, const char *text, char *error, size_t error_size);

// Bring the element into normal form: keep at most one spring and one damper in each group, and order each group:
// first its subgroups, then s, then d. Two elements with equal normal forms differ only in order and repetition.
void kn_element_normalize(kn_element *e);

// Print the tree under a node (e->root: the whole element). Every group within a group is in parentheses. If
// `numbered`, springs and dampers get numbers in the order of the text (s1, s2, d1 ..). These are the names of the
// parameters.
void kn_element_print(const kn_element *e, int node, bool numbered, char text[KN_ELEMENT_TEXT]);

// Store the name of a spring or damper, such as "s2" or "d1". Return false if the element has no leaf of this number.
bool kn_element_leaf_name(const kn_element *e, int leaf, char name[8]);

// Return the number of springs or of dampers under a node.
int kn_element_count(const kn_element *e, int node, kn_element_kind kind);

// Return the name of an element in normal form, as a static text, or NULL if the element has none of the names above.
const char *kn_element_name(const kn_element *normal);

// Return true if the tree under a node has the property by the paper's rules above. Residual: a part of the deformation
// stays. Bouncing: a part of the deformation comes back. Vibration dies: a vibration fades away.
bool kn_element_residual(const kn_element *e, int node);
bool kn_element_bouncing(const kn_element *e, int node);
bool kn_element_vibration_dies(const kn_element *e, int node);

// The elements of the first paper's figure 2, (a) to (k). Their drawings are lost, so they were reconstructed from the
// paper's text about each of them. The provenance tells how sure a reconstruction is.
typedef enum kn_provenance {
    KN_PROVENANCE_FORCED, // no other element of this size fits the paper's text, or for d and f, text and figure 3
    KN_PROVENANCE_PAIR,   // two elements fit two letters; which element has which letter is a guess
    KN_PROVENANCE_GUESS   // one of four elements that fit the paper's text; the four have equal one-ports (oneport.h)
} kn_provenance;

typedef struct kn_catalogue_entry {
    char letter;                   // letter of the drawing in figure 2, 'a' to 'k'
    const char *expression;        // the element in normal form
    bool residual, vibration_dies; // properties as the paper states them; every entry also has the property bouncing
    kn_provenance provenance;
    const char *because; // reason for the reconstruction, one sentence
} kn_catalogue_entry;

#define KN_CATALOGUE 11
extern const kn_catalogue_entry kn_catalogue[KN_CATALOGUE];

#endif
