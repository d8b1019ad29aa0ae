#ifndef KN_CLIENTS_BUZZ_H
#define KN_CLIENTS_BUZZ_H
// What a fingertip feels as buzz: the root mean square of a signal above 10 Hz. A second-order Butterworth high-pass
// (bilinear, at the sampling rate given), squares summed since the last reset. Judge on force: position hides a chatter
// of 500 Hz, which is an amplitude of micrometres.
#define KN_BUZZ_HZ 10.0

typedef struct kn_buzz { // read only but through the functions
    double b, a1, a2;    // y = b (x - 2 x1 + x2) - a1 y1 - a2 y2
    double x1, x2, y1, y2;
    double sum;
    long count;
} kn_buzz;

// first: the signal up to now, so that a constant is silence from the beginning.
void kn_buzz_init(kn_buzz *buzz, double period_s, double first);
void kn_buzz_add(kn_buzz *buzz, double value);
void kn_buzz_reset(kn_buzz *buzz);       // the sum, not the filter
double kn_buzz_rms(const kn_buzz *buzz); // 0 of nothing

// How often a signal turns round by more than a hysteresis: what a step or stroke leaves at one or two and a buzz does
// not. A signal that turns 20 times in a second swings with 10 Hz.
typedef struct kn_turns {
    double hysteresis, extreme; // > 0; since the last turn
    int up;                     // which way it goes; 0: not known yet
    int count;
} kn_turns;
void kn_turns_add(kn_turns *turns, double value);

#endif
