#ifndef KN_SERVER_PHASE_H
#define KN_SERVER_PHASE_H
// Phase lock: the servo's grid moves to where the driving probe's poses arrive, so that a pose waits tens of us for its
// tick. On a grid of its own it waits half a period on average, and as two crystals differ, any wait up to a whole one
// comes round every few seconds, with a pose left out or used twice each time.
//
//     poses      |     . |       . |     .   |      .  |      arrive with jitter around a place in the period
//     ticks      #       #         #         #                just behind most of them, and held back for the others
//
// For each pose that came since the last tick:
//     wait = tick's wake - pose's arrival, on the circle of one period         how late ticks wake is part of it
//     centre += (wait - centre) / 32, spread += (|wait - centre| - spread) / 128      outliers count for 0.1 ms
//     margin += 1 us (1 - late) when the pose came after its tick was awake, else -= 1 us * late
//     the grid moves by margin - centre, at most KN_PHASE_SLEW_NS, and the centre with it
// The margin comes to rest where the share `late` of the poses is late. Two crystals 100 ppm apart are 0.1 us per tick:
// the centre trails by 3 us. An arrival half a period off takes 0.25 s.
//
// A late pose would wait a whole period, and mostly the next one overtakes it, so that it is never answered. A margin
// for all of them (99.6 % need 0.1 ms on a busy machine) costs every pose that much. So a tick that is awake before its
// pose is held back for it, at most KN_PHASE_HOLD_NS; the grid does not move for it, the next tick is on time. This only
// while poses come steadily, one per tick; then far more of them may be late.
//
// A sender that answers forces follows the grid itself, and both would run off together, 0.2 % fast or slow. Whoever
// takes the grid further than KN_PHASE_RUN_NS in KN_PHASE_RUN_TICKS is not followed any more in that session.
//
// Where poses stop, come without a rhythm (spread) or with the machine's stalls, the grid stands still: a free clock.
// Ticks are never dropped or doubled, and due never closer than the period less the slew. What a tick computes does not
// depend on any of this: its step is a period long, whatever the hardware's clock says. Pure; real-time safe.
#include "server/clock.h"

#define KN_PHASE_SLEW_NS 2000   // most per tick: a tenth of what waking up varies by, 0.2 % of a period
#define KN_PHASE_LATE 0.004     // share of the poses that may come after their tick: they wait for the next
#define KN_PHASE_LATE_HELD 0.2  // where the tick waits for them, which costs less than a wait of all others
#define KN_PHASE_HOLD_NS 300000 // and no more than a third of the time that the last tick left of its period
#define KN_PHASE_STEADY 4       // poses are, from this score on: one up per tick with a new one,
#define KN_PHASE_STEADY_LOSS                                                                                           \
    2 // so much down per tick without: at 500 Hz they are not, with a fifth of them lost they are
#define KN_PHASE_STEADY_MAX 12  // when poses stop, five ticks are held for nothing
#define KN_PHASE_RUN_TICKS 2000 // half a period to begin with, and 500 ppm: worse than any crystal
#define KN_PHASE_RUN_NS 1500000
#define KN_PHASE_MARGIN_NS 40000 // at the start
#define KN_PHASE_MARGIN_MIN 10000
#define KN_PHASE_MARGIN_MAX 200000 // more would cost every pose more than a late one now and then
#define KN_PHASE_LOCK_NS 100000    // a rhythm: poses come this near to their mean place, on average; 0.25 ms is none
#define KN_PHASE_LOSE_NS 150000

typedef struct kn_arrival { // what a tick knows of one probe
    int64_t session;        // 0: nobody moves it
    int64_t arrived_ns;     // its latest pose
    int64_t earlier_ns;     // the one before that
    bool fresh;             // no earlier tick has used the latest
    bool engaged;           // the probe is in the model
} kn_arrival;

typedef struct kn_phase {
    bool locked; // the grid follows
    int probe;   // whose poses it follows, -1: nobody's
    int64_t session;
    double centre_ns, spread_ns, margin_ns;
    int steady;                     // score, 0 .. KN_PHASE_STEADY_MAX
    int64_t before_ns;              // wake of the tick before, if it had no new pose; else 0
    int64_t run_ns;                 // that the grid has moved
    int run;                        // for so many poses
    bool lost;                      // it runs away, and is not followed
    int64_t driven, followed, held; // ticks with a driver; of these: locked; held back
} kn_phase;

void kn_phase_init(kn_phase *phase);

// Before a tick that is due: the probe whose pose it is to be held back for, -1: nobody's.
int kn_phase_awaits(const kn_phase *phase);

// After a tick. How far the grid is to move, > 0: later. Drives: the probe that was engaged first, as long as it is;
// while none is engaged, the first that has a session, so that the phase stands when it touches.
int64_t kn_phase_tick(kn_phase *phase, const kn_arrival *arrival, int probes, const kn_wake *wake);

#endif
