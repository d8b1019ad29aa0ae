#ifndef KN_CORE_AHEAD_H
#define KN_CORE_AHEAD_H
// Search for the places of the skin that a tool will touch next. It serves tools of several parts and tools whose shape
// is a surface file. The tool may already press other places. (A tool of one convex part has only one such place, see
// kn_clearance.)
//
// A sweep visits every node of the skin, some of them in each tick. A node becomes a place if it is nearer to the tool
// than all neighbours of the node, and if no pressed patch (patch.h) is next to the node. The places stay the same
// until the next sweep is complete.
//
// kn_ahead_places computes the exact point, distance and direction of a place. It starts at the node and moves along
// the skin by (d + r) times the tangential part of the distance gradient. Here d is the distance at the node and r the
// tool's smallest half width. If the tool is a ball of radius r there, the result is the nearest point.
#include "core/patch.h"
#include "core/state.h"

typedef struct kn_place {
    int node;         // node of the skin at which the sweep found the place
    double gap_m;     // distance from the tool to the skin; > 0: no contact
    double normal[3]; // unit normal of the skin, out of the object
    double arm_m[3];  // vector from the tool's position to the point of the tool that will touch [m]
} kn_place;

typedef struct kn_ahead kn_ahead;

// Create the search for tool `p`. `model` and `patches` must outlive the search. Places farther away than reach_m are
// not reported. Return NULL if memory is short, or if tool p is a plate or has one convex part.
kn_ahead *kn_ahead_create(const kn_model *model, const kn_patches *patches, int p, double reach_m);
void kn_ahead_destroy(kn_ahead *ahead); // does nothing if `ahead` is NULL
void kn_ahead_reset(kn_ahead *ahead);   // forget the places found so far and begin a new sweep

// Visit one tick's share of the skin's nodes in the sweep for places that the tool will touch. Call once per tick.
// Real-time safe.
void kn_ahead_look(kn_ahead *ahead, const kn_state *state);

// Store at most `most` places of the last sweep in place[], with their present distances. Return the number of places
// that are within the tool's reach and not touched yet. Real-time safe.
int kn_ahead_places(const kn_ahead *ahead, const kn_state *state, int most, kn_place place[]);

#endif
